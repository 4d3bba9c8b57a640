//! Charts onto pages: bottom-left on bitmaps, the largest first, holes filled by the small ones.

use super::bitmap::Bitmap;
use crate::chart::Chart;
use crate::error::Error;

/// Cells along the side of a page whose area is that of the charts while its size is searched for.
const COARSE_CELLS: f64 = 150.0;
/// The same for the final places; finer does not fit more.
const FINE_CELLS: f64 = 450.0;
/// Orders of the charts that are tried: the first by size, the others near it.
const ORDERS: usize = 48;
/// How far the size of a chart may be misjudged in these: a factor, as a power of two.
const SHUFFLE: f64 = 1.5;
/// Most texels of a page: 8192 x 8192, which take 2.7 GB as points of the surface.
const MAX_TEXELS: usize = 1 << 26;
/// Smallest side of a page, relative to that of a square of the charts' area, and how much larger the next one is.
const SIDES: [f64; 2] = [1.02, 1.012];

/// Which turns the packer may try.
#[derive(Debug, Clone, Copy, Default, PartialEq, Eq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub enum Turns {
    /// None: charts stand as they are.
    None,
    /// Quarters of a circle.
    Quarter,
    /// Sixteenths of a circle.
    #[default]
    Any,
}

impl Turns {
    fn count(self) -> usize {
        match self {
            Self::None => 1,
            Self::Quarter => 4,
            Self::Any => 16,
        }
    }
}

/// How charts are laid onto pages.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(deny_unknown_fields, default))]
pub struct PackSettings {
    /// Side of a texel on the surface, metres. Default 0.0125 (thesis, 8.3.1).
    pub texel_m: f64,
    /// Texels that stay free between two charts. Default 2.
    pub gutter: usize,
    /// Columns and rows of a page, texels. `None` (default): one square page, as small as was found.
    pub page: Option<[usize; 2]>,
    /// Turns that may be tried. Default [`Turns::Any`]; [`Turns::None`] keeps upright charts upright.
    pub turns: Turns,
}

impl Default for PackSettings {
    fn default() -> Self {
        Self { texel_m: 0.0125, gutter: 2, page: None, turns: Turns::default() }
    }
}

/// Where a chart lies.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Placement {
    /// Page, from 0.
    pub page: usize,
    /// Cosine and sine of the turn.
    pub turn: [f64; 2],
    /// What is added after the turn, metres.
    pub shift: [f64; 2],
}

impl Placement {
    /// Place on the page, metres from its lower left corner, of a point of the chart.
    pub fn apply(&self, [u, v]: [f64; 2]) -> [f64; 2] {
        let [c, s] = self.turn;
        [c * u - s * v + self.shift[0], s * u + c * v + self.shift[1]]
    }
}

/// Columns and rows of a page, texels.
pub type Page = [usize; 2];

/// A chart in one of its turns, as cells.
struct Shape {
    turn: [f64; 2],
    /// Lower left corner of the turned chart.
    corner: [f64; 2],
    size: [usize; 2],
    outline: Vec<(u32, [usize; 2])>,
    /// With the gutter around it.
    wide: Bitmap,
}

/// A place for every chart, and the pages.
///
/// # Errors
/// [`Error::Setting`]; [`Error::TooManyTexels`] where a chart is larger than a page.
pub(super) fn pack(charts: &[Chart], settings: &PackSettings) -> Result<(Vec<Placement>, Vec<Page>), Error> {
    let area: f64 = charts.iter().map(|c| c.quality().area_m2).sum();
    let side = area.sqrt() / settings.texel_m;
    let scale = |cells: f64| (side / cells).ceil().max(1.0) as usize;
    let texels_per_cell = scale(FINE_CELLS);
    let fine = shapes(charts, settings, texels_per_cell);
    let packed = if let Some(page) = settings.page {
        on_pages(&fine, &orders(charts)[0], page.map(|texels| texels / texels_per_cell), usize::MAX)
    } else {
        let coarse = shapes(charts, settings, scale(COARSE_CELLS));
        let by_area = orders(charts);
        let (order, _) = smallest_square(&coarse, &by_area, side / scale(COARSE_CELLS) as f64);
        smallest_square(&fine, &[order], side / texels_per_cell as f64).1
    };
    let shapes = fine.turned;
    let cell = settings.texel_m * texels_per_cell as f64;
    let Some(packed) = packed else {
        let [width, height] = settings.page.unwrap_or_default();
        return Err(Error::TooManyTexels {
            texel_m: settings.texel_m,
            width: width as f64,
            height: height as f64,
            limit: width * height,
        });
    };
    let placements = packed
        .places
        .iter()
        .zip(&shapes)
        .map(|(&(page, turn, [column, row]), turns)| {
            let shape = &turns[turn];
            let shift = [column as f64 * cell - shape.corner[0], row as f64 * cell - shape.corner[1]];
            Placement { page, turn: shape.turn, shift }
        })
        .collect();
    let square = |used: &[usize; 2]| [used[0].max(used[1]) * texels_per_cell; 2];
    let pages = packed.used.iter().map(|used| settings.page.unwrap_or_else(|| square(used))).collect();
    Ok((placements, pages))
}

/// Refuses what could not be packed, before anything is cut: `area_m2` is that of the whole surface.
pub(super) fn check(settings: &PackSettings, area_m2: f64) -> Result<(), Error> {
    if !(settings.texel_m.is_finite() && settings.texel_m > 0.0) {
        return Err(Error::Setting { name: "texel_m", value: settings.texel_m, must_be: "positive" });
    }
    if let Some(page) = settings.page
        && page.contains(&0)
    {
        return Err(Error::Setting { name: "page", value: 0.0, must_be: "at least 1 x 1 texels" });
    }
    let side = area_m2.sqrt() / settings.texel_m;
    let [width, height] = settings.page.map_or([side; 2], |page| page.map(|side| side as f64));
    if side * side > MAX_TEXELS as f64 || width * height > MAX_TEXELS as f64 {
        return Err(Error::TooManyTexels { texel_m: settings.texel_m, width, height, limit: MAX_TEXELS });
    }
    Ok(())
}

fn shape(chart: &Chart, k: usize, turns: Turns, cell: f64, gutter: usize) -> Shape {
    let angle = std::f64::consts::TAU * k as f64 / turns.count() as f64;
    // Quarters must not round.
    let exact = |x: f64| if x.abs() < 1e-9 || x.abs() > 1.0 - 1e-9 { x.round() } else { x };
    let turn = [exact(angle.cos()), exact(angle.sin())];
    let turned: Vec<[f64; 2]> =
        chart.uv().iter().map(|&[u, v]| [turn[0] * u - turn[1] * v, turn[1] * u + turn[0] * v]).collect();
    let extreme = |k: usize, pick: fn(f64, f64) -> f64| turned.iter().map(|p| p[k]).reduce(pick).unwrap_or(0.0);
    let corner = [extreme(0, f64::min), extreme(1, f64::min)];
    let size = [extreme(0, f64::max) - corner[0], extreme(1, f64::max) - corner[1]];
    let corners = chart
        .disk()
        .faces()
        .iter()
        .map(|face| face.map(|v| turned[v as usize]).map(|p| [p[0] - corner[0], p[1] - corner[1]]));
    let cells = Bitmap::of_triangles(corners, size, cell);
    Shape { turn, corner, size: [cells.columns, cells.rows], outline: cells.outline(), wide: cells.dilated(gutter) }
}

struct Packed {
    /// Page, turn, column and row of every chart.
    places: Vec<(usize, usize, [usize; 2])>,
    /// Columns and rows that are used of every page.
    used: Vec<[usize; 2]>,
}

/// All charts in all turns.
struct Shapes {
    turned: Vec<Vec<Shape>>,
    gutter: usize,
}

fn shapes(charts: &[Chart], settings: &PackSettings, texels_per_cell: usize) -> Shapes {
    let cell = settings.texel_m * texels_per_cell as f64;
    let gutter = settings.gutter.div_ceil(texels_per_cell);
    let turned = charts
        .iter()
        .map(|chart| (0..settings.turns.count()).map(|k| shape(chart, k, settings.turns, cell, gutter)).collect())
        .collect();
    Shapes { turned, gutter }
}

/// Orders in which charts are placed: by area, and with areas misjudged at random, the same for the same charts.
fn orders(charts: &[Chart]) -> Vec<Vec<usize>> {
    let mut state = 0_u64;
    let mut random = || {
        // splitmix64
        state = state.wrapping_add(0x9e37_79b9_7f4a_7c15);
        let mut z = state;
        z = (z ^ (z >> 30)).wrapping_mul(0xbf58_476d_1ce4_e5b9);
        z = (z ^ (z >> 27)).wrapping_mul(0x94d0_49bb_1331_11eb);
        (z ^ (z >> 31)) as f64 / u64::MAX as f64
    };
    let count = if charts.len() < 2 { 1 } else { ORDERS };
    (0..count)
        .map(|trial| {
            let misjudged = |chart: &Chart, by: f64| chart.quality().area_m2 * (SHUFFLE * by).exp2();
            let size: Vec<f64> = charts.iter().map(|c| misjudged(c, if trial == 0 { 0.0 } else { random() })).collect();
            let mut order: Vec<usize> = (0..charts.len()).collect();
            order.sort_by(|&a, &b| size[b].total_cmp(&size[a]).then(a.cmp(&b)));
            order
        })
        .collect()
}

/// The smallest square page that one of the orders fits on, and that order.
fn smallest_square(shapes: &Shapes, orders: &[Vec<usize>], side: f64) -> (Vec<usize>, Option<Packed>) {
    let mut best = (orders[0].clone(), None);
    let mut limit = f64::INFINITY;
    for order in orders {
        // From below for the first, then only what beats the best so far.
        let mut cells = (SIDES[0] * side).ceil();
        if limit.is_finite() {
            cells = limit - 1.0;
        }
        loop {
            if let Some(packed) = on_pages(shapes, order, [cells as usize; 2], 1) {
                limit = packed.used[0].iter().copied().max().unwrap_or(1) as f64;
                best = (order.clone(), Some(packed));
                if cells <= (SIDES[0] * side).ceil() {
                    return best;
                }
                if orders.len() == 1 {
                    break;
                }
                cells = limit - 1.0;
            } else if best.1.is_none() {
                cells = (cells * SIDES[1]).ceil().max(cells + 1.0);
            } else {
                break;
            }
        }
    }
    best
}

/// The charts on pages of this size, at most so many.
fn on_pages(shapes: &Shapes, order: &[usize], size: [usize; 2], most: usize) -> Option<Packed> {
    let gutter = shapes.gutter as isize;
    let mut pages: Vec<Bitmap> = Vec::new();
    let mut packed = Packed { places: vec![(0, 0, [0; 2]); order.len()], used: Vec::new() };
    for &chart in order {
        let mut page = 0;
        let (turn, [column, row]) = loop {
            let fresh = page == pages.len();
            if page == most {
                return None;
            }
            if fresh {
                pages.push(Bitmap::new(size[0], size[1]));
                packed.used.push([0; 2]);
            }
            if let Some(place) = best_place(&pages[page], &shapes.turned[chart]) {
                break place;
            }
            if fresh {
                return None;
            }
            page += 1;
        };
        let shape = &shapes.turned[chart][turn];
        pages[page].stamp(&shape.wide, column as isize - gutter, row as isize - gutter);
        packed.places[chart] = (page, turn, [column, row]);
        let used = &mut packed.used[page];
        *used = [used[0].max(column + shape.size[0]), used[1].max(row + shape.size[1])];
    }
    Some(packed)
}

/// The turn and place with the lowest upper edge; of equals the lowest, then the leftmost.
fn best_place(page: &Bitmap, turns: &[Shape]) -> Option<(usize, [usize; 2])> {
    let mut best: Option<([usize; 3], usize, [usize; 2])> = None;
    for (turn, shape) in turns.iter().enumerate() {
        let below = best.map_or(usize::MAX, |(key, ..)| key[0].saturating_sub(shape.size[1]));
        if let Some(place) = page.lowest_place(&shape.outline, shape.size, below) {
            let key = [place[1] + shape.size[1], place[1], place[0]];
            if best.is_none_or(|(least, ..)| key < least) {
                best = Some((key, turn, place));
            }
        }
    }
    best.map(|(_, turn, place)| (turn, place))
}
