//! Twenty drawings of lines: letters of six sizes, curves and joints, as polylines with a width.

use paint_net::Image;

/// Ink of a line.
pub(super) const INK: f64 = 0.85;
/// Bare pixels around a drawing.
const MARGIN: f64 = 12.0;

type Point = [f64; 2];
type Polyline = Vec<Point>;

/// Lines of one width with round ends.
pub(super) struct Drawing {
    pub(super) name: String,
    /// Middles of the lines, pixels.
    pub(super) lines: Vec<Polyline>,
    pub(super) width: f64,
    size: (usize, usize),
}

impl Drawing {
    /// Moves the lines into a picture that has room for them.
    fn new(name: impl Into<String>, mut lines: Vec<Polyline>, width: f64) -> Self {
        let (mut low, mut high) = ([f64::MAX; 2], [f64::MIN; 2]);
        for p in lines.iter().flatten() {
            for c in 0..2 {
                (low[c], high[c]) = (low[c].min(p[c]), high[c].max(p[c]));
            }
        }
        let room = MARGIN + 0.5 * width;
        lines.iter_mut().flatten().for_each(|p| *p = [0, 1].map(|c| p[c] - low[c] + room));
        let side = |c: usize| (high[c] - low[c] + 2.0 * room).ceil() as usize;
        Self { name: name.into(), lines, width, size: (side(0), side(1)) }
    }

    /// Distance to the nearest middle of a line.
    pub(super) fn distance_to_middle(&self, p: Point) -> f64 {
        let segments = self.lines.iter().flat_map(|line| line.windows(2));
        segments.map(|s| to_segment(p, s[0], s[1])).fold(f64::INFINITY, f64::min)
    }

    /// The wanted ink, smooth over one pixel at the borders.
    pub(super) fn wanted(&self) -> Image {
        let inside = |x: usize, y: usize| 0.5 + 0.5 * self.width - self.distance_to_middle([x as f64, y as f64]);
        Image::from_fn(self.size.0, self.size.1, |x, y| INK * inside(x, y).clamp(0.0, 1.0))
    }
}

fn to_segment([x, y]: Point, [ax, ay]: Point, [bx, by]: Point) -> f64 {
    let (dx, dy) = (bx - ax, by - ay);
    let along = (((x - ax) * dx + (y - ay) * dy) / (dx * dx + dy * dy).max(1e-12)).clamp(0.0, 1.0);
    (x - ax - along * dx).hypot(y - ay - along * dy)
}

/// From an angle to another, degrees counter-clockwise where y runs up.
fn arc([x, y]: Point, [rx, ry]: Point, from: f64, to: f64) -> Polyline {
    let at = |k: i32| {
        let angle = (from + (to - from) * f64::from(k) / 48.0).to_radians();
        [x + rx * angle.cos(), y + ry * angle.sin()]
    };
    (0..=48).map(at).collect()
}

fn curve(count: i32, at: impl Fn(f64) -> Point) -> Polyline {
    (0..=count).map(|k| at(f64::from(k) / f64::from(count))).collect()
}

/// Lines of a letter one high, y up from the line of writing.
fn letter(letter: char) -> Vec<Polyline> {
    let joined = |parts: &[Polyline]| parts.concat();
    match letter {
        'A' => vec![vec![[0.0, 0.0], [0.35, 1.0], [0.7, 0.0]], vec![[0.12, 0.35], [0.58, 0.35]]],
        'E' => vec![vec![[0.55, 0.0], [0.0, 0.0], [0.0, 1.0], [0.55, 1.0]], vec![[0.0, 0.5], [0.45, 0.5]]],
        'K' => vec![vec![[0.0, 0.0], [0.0, 1.0]], vec![[0.6, 1.0], [0.0, 0.4]], vec![[0.2, 0.6], [0.65, 0.0]]],
        'M' => vec![vec![[0.0, 0.0], [0.0, 1.0], [0.4, 0.3], [0.8, 1.0], [0.8, 0.0]]],
        'R' => vec![
            joined(&[vec![[0.0, 0.0], [0.0, 1.0]], arc([0.33, 0.75], [0.25, 0.25], 90.0, -90.0), vec![[0.0, 0.5]]]),
            vec![[0.3, 0.5], [0.6, 0.0]],
        ],
        'S' => {
            vec![joined(&[arc([0.3, 0.75], [0.28, 0.25], 20.0, 270.0), arc([0.3, 0.25], [0.28, 0.25], 90.0, -160.0)])]
        }
        'e' => vec![joined(&[vec![[0.03, 0.33], [0.55, 0.33]], arc([0.3, 0.3], [0.27, 0.3], 10.0, 320.0)])],
        'a' => vec![arc([0.3, 0.28], [0.28, 0.28], 0.0, 360.0), vec![[0.58, 0.6], [0.58, 0.0]]],
        'g' => vec![
            arc([0.3, 0.3], [0.27, 0.28], 0.0, 360.0),
            joined(&[vec![[0.57, 0.6]], arc([0.3, -0.1], [0.27, 0.25], 0.0, -150.0)]),
        ],
        '8' => vec![arc([0.3, 0.77], [0.23, 0.23], 0.0, 360.0), arc([0.3, 0.27], [0.28, 0.27], 0.0, 360.0)],
        other => unreachable!("no letter {other}"),
    }
}

/// A line of writing of this height, pixels, y down.
fn text(writing: &str, height: f64, width: f64) -> Drawing {
    let mut left = 0.0;
    let mut lines = Vec::new();
    for c in writing.chars() {
        let glyph = letter(c);
        let right = glyph.iter().flatten().fold(0.0_f64, |most, p| most.max(p[0]));
        lines.extend(glyph.into_iter().map(|l| l.iter().map(|p| [left + height * p[0], -height * p[1]]).collect()));
        left += height * right + 2.2 * width;
    }
    Drawing::new(format!("letters {height} px high, lines of {width} px"), lines, width)
}

/// Letters of six sizes, seven drawings of curves and seven of joints.
pub(super) fn all() -> Vec<Drawing> {
    let tau = std::f64::consts::TAU;
    let mut drawings: Vec<Drawing> = [(22.0, 3.0), (30.0, 4.0), (38.0, 5.0), (46.0, 6.0), (52.0, 7.0), (60.0, 8.0)]
        .into_iter()
        .zip(["RASKe8g", "MaEgK", "SeRA8", "RASKeg", "gaR8e", "SAKe"])
        .map(|((height, width), writing)| text(writing, height, width))
        .collect();
    let turn = |angle: f64, r: f64| [r * (tau * angle).cos(), r * (tau * angle).sin()];
    let rays = |count: u32, from: f64, length: f64| -> Vec<Polyline> {
        (0..count).map(|k| vec![[0.0, 0.0], turn(from + f64::from(k) / f64::from(count), length)]).collect()
    };
    let mut add = |name: &str, lines: Vec<Polyline>, width: f64| drawings.push(Drawing::new(name, lines, width));
    add("circle", vec![arc([0.0, 0.0], [25.0, 25.0], 0.0, 360.0)], 6.0);
    add("small circle", vec![arc([0.0, 0.0], [8.0, 8.0], 0.0, 360.0)], 5.0);
    add("spiral", vec![curve(400, |t| turn(2.75 * t, 4.0 + 42.0 * t))], 6.0);
    add("sine", vec![curve(400, |t| [130.0 * t, 18.0 * (3.0 * tau * t).sin()])], 7.0);
    add("steep sine", vec![curve(400, |t| [110.0 * t, 22.0 * (5.0 * tau * t).sin()])], 4.0);
    let trefoil = |t: f64| {
        let (once, twice) = (tau * t, 2.0 * tau * t);
        [16.0 * (once.sin() + 2.0 * twice.sin()), 16.0 * (once.cos() - 2.0 * twice.cos())]
    };
    add("trefoil", vec![curve(400, trefoil)], 6.0);
    add("figure of eight", vec![curve(300, |t| [44.0 * (tau * t).sin(), 24.0 * (2.0 * tau * t).sin()])], 7.0);
    add("T", vec![vec![[0.0, 0.0], [60.0, 0.0]], vec![[30.0, 0.0], [30.0, 50.0]]], 7.0);
    add("Y", rays(3, 0.25, 36.0), 6.0);
    add("acute X", vec![vec![[0.0, 0.0], [90.0, 30.0]], vec![[0.0, 30.0], [90.0, 0.0]]], 6.0);
    add("star", rays(7, 0.1, 40.0), 5.0);
    let grid = (0..4).flat_map(|k| {
        let at = 22.0 * f64::from(k);
        [vec![[at, 0.0], [at, 66.0]], vec![[0.0, at], [66.0, at]]]
    });
    add("grid", grid.collect(), 6.0);
    let teeth = (0..6).map(|k| vec![[16.0 * f64::from(k), 0.0], [16.0 * f64::from(k), 30.0]]);
    add("comb", teeth.chain([vec![[0.0, 0.0], [80.0, 0.0]]]).collect(), 7.0);
    add("zigzag", vec![curve(9, |t| [110.0 * t, if ((9.0 * t).round() as i32) % 2 == 0 { 0.0 } else { 38.0 }])], 6.0);
    drawings
}
