// A curve of the last seconds on a canvas, with a band for the camera's noise; degrees (or what the joints count in) over time.

const LEFT = 40;

export class Curve {
  constructor(canvas, seconds) {
    this.canvas = canvas;
    this.g = canvas.getContext('2d');
    this.seconds = seconds;
    this.points = [];
    this.top = 0;
    this.size = { width: 0, height: 0, ratio: 1 };
  }

  resize(width, height, ratio) {
    this.size = { width, height, ratio };
    this.canvas.width = Math.round(width * ratio);
    this.canvas.height = Math.round(height * ratio);
  }

  add(time, value) {
    if (this.points.length && time < this.points[this.points.length - 1][0]) this.points.length = 0;
    this.points.push([time, value]);
    while (this.points.length && time - this.points[0][0] > this.seconds * 1000) this.points.shift();
  }

  clear() {
    this.points.length = 0;
    this.g.setTransform(1, 0, 0, 1, 0, 0);
    this.g.clearRect(0, 0, this.canvas.width, this.canvas.height);
  }

  draw(now, noise, colours, { unit, least }) {
    const { width, height, ratio } = this.size, g = this.g;
    if (!width || !height) return;
    g.setTransform(ratio, 0, 0, ratio, 0, 0);
    g.clearRect(0, 0, width, height);
    const largest = this.points.reduce((most, [, value]) => value === null ? most : Math.max(most, value), least) * 1.1;
    // The scale grows at once and shrinks slowly: a curve that jumps up and down cannot be read.
    this.top = largest > this.top ? largest : this.top + (largest - this.top) * 0.02;
    const x = time => LEFT + (width - LEFT) * (1 - (now - time) / 1000 / this.seconds);
    const y = value => height - 2 - (height - 8) * value / this.top;
    if (noise > 0) {
      g.fillStyle = colours.s3;
      g.fillRect(LEFT, y(noise), width - LEFT, height - 2 - y(noise));
    }
    const step = [0.05, 0.1, 0.2, 0.5, 1, 2, 5, 10, 20].find(step => this.top / step < 3 && (height - 8) * step / this.top >= 20) ?? 50;
    g.font = '13px Inter, "Segoe UI", Roboto, "Helvetica Neue", Arial, sans-serif';
    g.textAlign = 'right';
    g.textBaseline = 'middle';
    g.lineWidth = 1;
    for (let value = 0; value < this.top; value += step) {
      g.strokeStyle = colours.rule;
      g.beginPath();
      g.moveTo(LEFT, Math.round(y(value)) + 0.5);
      g.lineTo(width, Math.round(y(value)) + 0.5);
      g.stroke();
      g.fillStyle = colours.t3;
      g.fillText(`${value}${unit}`, LEFT - 8, Math.max(7, Math.min(height - 7, y(value))));
    }
    g.strokeStyle = colours.trail;
    g.lineWidth = 2;
    g.lineJoin = 'round';
    g.beginPath();
    let isPen = false;
    for (const [time, value] of this.points) {
      if (value === null) { isPen = false; continue; }
      if (isPen) g.lineTo(x(time), y(value)); else g.moveTo(x(time), y(value));
      isPen = true;
    }
    g.stroke();
  }
}
