//! One picture: a plot, its heading, and a sentence that says what to see in it.

use super::html::escape;
use super::visits::Points;
use plotly::common::{Anchor, DashType, ErrorData, ErrorType, Line, Mode};
use plotly::layout::{Annotation, Axis, Legend, Shape, ShapeLine, ShapeType};
use plotly::{Configuration, Layout, Plot, Scatter, Trace};

/// Colours that also the colour-blind tell apart: measurement, model as given, model with effects, others.
pub const COLOURS: [&str; 6] = ["#444444", "#d55e00", "#0072b2", "#009e73", "#cc79a7", "#e69f00"];

/// A picture, or the sentence that says why there is none.
pub struct Picture {
    title: String,
    sentence: String,
    plot: Option<Plot>,
}

impl Picture {
    /// A picture of these traces over named axes.
    pub fn new(title: &str, sentence: &str, x: &str, y: &str, traces: Vec<Box<dyn Trace>>) -> Self {
        Self::with_layout(title, sentence, layout(x, y), traces)
    }

    /// A picture with its own layout.
    pub fn with_layout(title: &str, sentence: &str, layout: Layout, traces: Vec<Box<dyn Trace>>) -> Self {
        let mut plot = Plot::new();
        plot.add_traces(traces);
        plot.set_layout(layout);
        plot.set_configuration(Configuration::new().responsive(true).display_logo(false));
        Self { title: title.to_owned(), sentence: sentence.to_owned(), plot: Some(plot) }
    }

    /// No picture, and why.
    pub fn none(title: &str, why: &str) -> Self {
        Self { title: title.to_owned(), sentence: why.to_owned(), plot: None }
    }

    /// Its markup; `number` makes its name on the page.
    pub fn markup(&self, number: usize) -> String {
        let head =
            format!("<figure>\n<figcaption><b>{}.</b> {}</figcaption>\n", escape(&self.title), escape(&self.sentence));
        let Some(plot) = &self.plot else { return head + "</figure>\n" };
        // Inside a script only "<" can end it: names from outside must not.
        let json = plot.to_json().replace('<', "\\u003c").replace('\u{2028}', "\\u2028").replace('\u{2029}', "\\u2029");
        format!(
            "{head}<div id=\"picture-{number}\" class=\"picture\"></div>\n\
             <script>Plotly.newPlot(\"picture-{number}\", {json});</script>\n</figure>\n"
        )
    }
}

/// Named axes, the legend above.
pub fn layout(x: &str, y: &str) -> Layout {
    let legend = Legend::new().y(1.02).y_anchor(plotly::common::Anchor::Bottom);
    let legend = legend.orientation(plotly::common::Orientation::Horizontal);
    Layout::new()
        .x_axis(axis(x))
        .y_axis(axis(y))
        .legend(legend)
        .show_legend(true)
        .margin(plotly::layout::Margin::new().top(70).left(70).right(20).bottom(50))
}

/// A named axis.
pub fn axis(title: &str) -> Axis {
    Axis::new().title(plain(title))
}

/// A curve.
pub fn line(name: &str, colour: usize, x: Vec<f64>, y: Vec<f64>) -> Box<Scatter<f64, f64>> {
    let own = Line::new().color(COLOURS[colour % COLOURS.len()]).width(1.5);
    Scatter::new(thin(x), thin(y)).mode(Mode::Lines).name(plain(name)).line(own)
}

/// A curve of the machine's output of this number: the first one is drawn through, others are dashed.
pub fn output_line(name: &str, colour: usize, output: usize, x: Vec<f64>, y: Vec<f64>) -> Box<Scatter<f64, f64>> {
    const DASHES: [DashType; 4] = [DashType::Solid, DashType::Dash, DashType::Dot, DashType::DashDot];
    let own = Line::new().color(COLOURS[colour % COLOURS.len()]).width(1.5).dash(DASHES[output % DASHES.len()].clone());
    line(name, colour, x, y).line(own)
}

/// Means with their error bars.
pub(super) fn whiskers(name: &str, colour: usize, points: Points) -> Box<Scatter<f64, f64>> {
    let bars = ErrorData::new(ErrorType::Data).array(thin(points.whisker));
    line(name, colour, points.x, points.mean).mode(Mode::LinesMarkers).error_y(bars)
}

/// The noise floor as a line across a picture, with its name and value; nothing where it is not known.
pub struct Floor {
    level: Option<f64>,
    label: String,
}

impl Floor {
    /// At this level, in `unit`.
    pub fn new(level: Option<f64>, name: &str, unit: &str) -> Self {
        let label = level.map_or(String::new(), |level| format!("{name} {level:.3} {unit}"));
        Self { level: level.filter(|level| level.is_finite()), label }
    }

    /// One line, of errors that have no sign.
    pub fn on(self, layout: Layout) -> Layout {
        let levels: Vec<f64> = self.level.into_iter().collect();
        self.drawn(layout, &levels)
    }

    /// Two lines, of errors with a sign.
    pub fn on_both_sides(self, layout: Layout) -> Layout {
        let levels: Vec<f64> = self.level.into_iter().flat_map(|level| [level, -level]).collect();
        self.drawn(layout, &levels)
    }

    fn drawn(&self, layout: Layout, levels: &[f64]) -> Layout {
        let Some(&first) = levels.first() else { return layout };
        let line = |&level: &f64| {
            let style = ShapeLine::new().color(COLOURS[3]).width(1.5).dash(DashType::Dash);
            let own = Shape::new().shape_type(ShapeType::Line).x_ref("paper").x0(0.0).x1(1.0);
            own.y_ref("y").y0(short(level)).y1(short(level)).line(style)
        };
        let name = Annotation::new().text(plain(&self.label)).show_arrow(false).x_ref("paper").x(1.0);
        let name = name.x_anchor(Anchor::Right).y_ref("y").y(short(first)).y_anchor(Anchor::Bottom);
        layout.shapes(levels.iter().map(line).collect()).annotations(vec![name])
    }
}

/// A name in which the plotting script finds no markup of its own.
pub fn plain(name: &str) -> String {
    escape(name)
}

/// Five digits are more than any screen shows, and a third of the bytes.
pub fn short(value: f64) -> f64 {
    if value.is_finite() { format!("{value:.4e}").parse().unwrap_or(value) } else { f64::NAN }
}

fn thin(values: Vec<f64>) -> Vec<f64> {
    values.into_iter().map(short).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_name_from_outside_ends_no_script_and_makes_no_markup() {
        let trace = line("</script><img src=x>", 0, vec![0.0, 1.0], vec![f64::NAN, 2.0 / 3.0]);
        let markup = Picture::new("a <b>", "see", "x", "</script>", vec![trace]).markup(1);
        assert_eq!(markup.matches("</script>").count(), 1, "the page's own: {markup}");
        assert!(!markup.contains("<img") && !markup.contains("a <b>"));
        assert!(markup.contains("[null,0.66667]"), "gaps are null, numbers short: {markup}");
    }
}
