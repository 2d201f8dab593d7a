"""Shows a recording of krait in Rerun with the snake's body drawn, which Rerun does not draw by itself.

    pip install rerun-sdk==0.41.0 mcap==1.6.0 mcap-protobuf-support==0.6.0
    python docs/rerun/blueprint.py run.mcap run.rrd
    rerun run.rrd

Measured and asked-for body, bend, encoders, loads and the log stand side by side, on one timeline: the wall clock.
"""

import json
import math
import sys

import rerun as rr
import rerun.blueprint as rrb
from mcap.exceptions import EndOfFile, McapError
from mcap.reader import NonSeekingReader
from mcap_protobuf.decoder import DecoderFactory

TIMELINE = "time"
# A foxglove.LinePrimitive's type: strip, loop, pairs.
LOOP, PAIRS = 1, 2
TOPICS = ["/snake/scene", "/krait/setpoint", "/krait/shape", "/krait/state", "/log"]
LEVELS = ["DEBUG", "DEBUG", "INFO", "WARN", "ERROR", "CRITICAL"]


def blueprint():
    """The body on the left with the log below it; curves on the right."""
    body = rrb.Spatial3DView(origin="/body", name="Snake: measured, and asked for")
    log = rrb.TextLogView(origin="/log", name="Log")
    curves = [
        rrb.TimeSeriesView(origin="/bend", name="Bend, degrees"),
        rrb.TimeSeriesView(origin="/lines", name="Encoders, mm"),
        rrb.TimeSeriesView(origin="/loads", name="Loads, N, push positive"),
    ]
    left = rrb.Vertical(body, log, row_shares=[3, 1])
    return rrb.Blueprint(rrb.Horizontal(left, rrb.Vertical(*curves), column_shares=[3, 2]), collapse_panels=True)


def strip(line):
    points = [[p.x, p.y, p.z] for p in line.points]
    if line.type == PAIRS:
        return [points[k : k + 2] for k in range(0, len(points) - 1, 2)]
    return [points + points[:1] if line.type == LOOP else points]


def rgba(color):
    return [round(255 * part) for part in (color.r, color.g, color.b, color.a)]


def draw(entity):
    """The lines of one body; returns how many."""
    strips, colors, radii = [], [], []
    for line in entity.lines:
        for own in strip(line):
            strips.append(own)
            colors.append(rgba(line.color or line.colors[0]))
            # A thickness in pixels is a negative radius in Rerun.
            radii.append(-line.thickness / 2 if line.scale_invariant else line.thickness / 2)
    rr.log(f"/body/{entity.id}", rr.LineStrips3D(strips, colors=colors, radii=radii))
    return len(strips)


def curve(path, value):
    if math.isfinite(value):
        rr.log(path, rr.Scalars(value))


def tell(topic, message, seen):
    """One message, as Rerun draws it."""
    if topic == "/snake/scene":
        for entity in message.entities:
            seen["strips"][entity.id] = draw(entity)
    elif topic == "/log":
        rr.log("/log", rr.TextLog(message.message, level=LEVELS[min(message.level, len(LEVELS) - 1)]))
    elif topic == "/krait/state":
        for name, factor, field in [("lines", 1e3, "measured_q_m"), ("loads", 1.0, "measured_tau_n")]:
            for own, value in getattr(message, field).ListFields():
                curve(f"/{name}/{own.name}", factor * value)
    else:
        of = "setpoint" if topic == "/krait/setpoint" else "measured"
        for axis in "xy":
            curve(f"/bend/{of}_{axis}", math.degrees(getattr(message.bend_rad, axis)))


def main(source, out):
    rr.init("krait")
    rr.save(out, default_blueprint=blueprint())
    seen = {"messages": {}, "strips": {}}
    with open(source, "rb") as file:
        # A recording that broke off has no index: it is read as it lies.
        reader = NonSeekingReader(file, decoder_factories=[DecoderFactory()])
        try:
            for item in reader.iter_decoded_messages(topics=TOPICS):
                rr.set_time(TIMELINE, timestamp=item.message.log_time / 1e9)
                tell(item.channel.topic, item.decoded_message, seen)
                seen["messages"][item.channel.topic] = seen["messages"].get(item.channel.topic, 0) + 1
        except EndOfFile:
            print(f"{source}: it breaks off; what lies before is drawn", file=sys.stderr)
    if not seen["strips"]:
        sys.exit(
            f"{source}: expected bodies in /snake/scene, found none; joints have none, and [record] view_hz = 0 leaves them out; so does a file that breaks off in its first chunk"
        )
    print(json.dumps(seen))


if __name__ == "__main__":
    if len(sys.argv) != 3:
        sys.exit("usage: python blueprint.py RUN.mcap OUT.rrd")
    try:
        main(sys.argv[1], sys.argv[2])
    except (OSError, McapError) as error:
        sys.exit(f"{sys.argv[1]}: expected a recording of krait (MCAP) that can be read, found: {error}; give another file")
