//! Where a picture lies on the plane it is painted on: size, turn and place, its own proportions kept.

use serde::{Deserialize, Serialize};

/// How large a picture becomes where no size is given.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default, Serialize, Deserialize)]
#[serde(rename_all = "snake_case")]
pub enum PlacementMode {
    /// As large as fits, whole; bare beside it.
    #[default]
    Fit,
    /// As small as covers everything; what stands over is cut off.
    Fill,
    /// Repeated, each a third of the longer side wide.
    Tile,
    /// Stretched over the box, proportions lost.
    Stretch,
}

/// Size, turn and place of a picture.
#[derive(Debug, Clone, Copy, PartialEq, Default, Serialize, Deserialize)]
#[serde(deny_unknown_fields, default)]
pub struct PicturePlacement {
    /// How large it becomes without [`size`](Self::size), and whether it is repeated.
    pub mode: PlacementMode,
    /// Turn about its middle, counter-clockwise, radians.
    pub rotate: f64,
    /// Its middle right of and above the middle of the box, metres.
    pub offset: [f64; 2],
    /// Width, metres; the height follows from its proportions.
    pub size: Option<f64>,
}

impl PicturePlacement {
    /// The place in a picture of `aspect` (width over height), both coordinates in `[0, 1]`, the second down, that lies at
    /// `(x, y)` metres from the upper left corner of a box; `None` beside the picture.
    pub fn locate(&self, [x, y]: [f64; 2], extent: [f64; 2], aspect: f64) -> Option<[f64; 2]> {
        let [width, height] = self.size_in(extent, aspect);
        let middle = [0.5 * extent[0] + self.offset[0], 0.5 * extent[1] - self.offset[1]];
        let (sin, cos) = self.rotate.sin_cos();
        let [dx, dy] = [x - middle[0], y - middle[1]];
        // y runs down: a counter-clockwise turn of the picture is a clockwise one of the place.
        let [u, v] = [(cos * dx - sin * dy) / width + 0.5, (sin * dx + cos * dy) / height + 0.5];
        if self.mode == PlacementMode::Tile {
            return Some([u.rem_euclid(1.0), v.rem_euclid(1.0)]);
        }
        let inside = |c: f64| (0.0..=1.0).contains(&c);
        (inside(u) && inside(v)).then_some([u, v])
    }

    /// Width and height in metres.
    pub(crate) fn size_in(&self, extent: [f64; 2], aspect: f64) -> [f64; 2] {
        if let Some(width) = self.size {
            return [width, width / aspect];
        }
        let (sin, cos) = (self.rotate.sin().abs(), self.rotate.cos().abs());
        let scale = match self.mode {
            PlacementMode::Stretch => return extent,
            PlacementMode::Tile => extent[0].max(extent[1]) / 3.0 / aspect,
            // The box of the turned picture, one high, in the extent.
            PlacementMode::Fit => (extent[0] / (aspect * cos + sin)).min(extent[1] / (aspect * sin + cos)),
            // The extent in the turned picture.
            PlacementMode::Fill => {
                ((extent[0] * cos + extent[1] * sin) / aspect).max(extent[0] * sin + extent[1] * cos)
            }
        };
        [aspect * scale, scale]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// On a box of 4 x 2 m: corners of the picture for every mode.
    #[test]
    fn pictures_keep_their_proportions() {
        let extent = [4.0, 2.0];
        let at = |mode, aspect: f64, place| {
            PicturePlacement { mode, ..PicturePlacement::default() }.locate(place, extent, aspect)
        };
        let near = |found: Option<[f64; 2]>, u: f64, v: f64| {
            let [a, b] = found.expect("inside the picture");
            assert!((a - u).abs() < 1e-12 && (b - v).abs() < 1e-12, "{a} {b}, wanted {u} {v}");
        };
        // A square picture fits as 2 x 2 m in the middle, and fills as 4 x 4 m.
        near(at(PlacementMode::Fit, 1.0, [1.0, 0.0]), 0.0, 0.0);
        near(at(PlacementMode::Fit, 1.0, [3.0, 2.0]), 1.0, 1.0);
        assert_eq!(at(PlacementMode::Fit, 1.0, [0.9, 1.0]), None);
        near(at(PlacementMode::Fill, 1.0, [0.0, 0.0]), 0.0, 0.25);
        near(at(PlacementMode::Stretch, 1.0, [4.0, 0.0]), 1.0, 0.0);
        // A portrait of 1 : 2 fits as 1 x 2 m.
        near(at(PlacementMode::Fit, 0.5, [1.5, 0.0]), 0.0, 0.0);
        // Tiles of 4/3 m: the middle of the box is the middle of one.
        near(at(PlacementMode::Tile, 1.0, [2.0, 1.0]), 0.5, 0.5);
        near(at(PlacementMode::Tile, 1.0, [2.0 - 4.0 / 3.0, 1.0]), 0.5, 0.5);
    }

    #[test]
    fn a_picture_is_turned_counter_clockwise_moved_right_and_up_and_sized() {
        let quarter = PicturePlacement { rotate: std::f64::consts::FRAC_PI_2, ..PicturePlacement::default() };
        // A landscape of 2 : 1 turned upright in a square of 2 m: its right end points up.
        let [u, v] = quarter.locate([1.0, 0.0], [2.0, 2.0], 2.0).unwrap();
        assert!((u - 1.0).abs() < 1e-12 && (v - 0.5).abs() < 1e-12, "{u} {v}");
        let moved = PicturePlacement { offset: [0.5, 0.25], size: Some(1.0), ..PicturePlacement::default() };
        // 1 x 0.5 m with its middle at x = 1.5 and 0.75 from the top.
        assert_eq!(moved.locate([1.0, 0.5], [2.0, 2.0], 2.0), Some([0.0, 0.0]));
        assert_eq!(moved.locate([2.0, 1.0], [2.0, 2.0], 2.0), Some([1.0, 1.0]));
        assert_eq!(moved.locate([0.9, 0.75], [2.0, 2.0], 2.0), None);
        // Filled at any angle, nothing stays bare.
        for degrees in 0..90 {
            let fill = PicturePlacement {
                mode: PlacementMode::Fill,
                rotate: f64::from(degrees).to_radians(),
                ..PicturePlacement::default()
            };
            for corner in [[0.0, 0.0], [3.0, 0.0], [0.0, 1.0], [3.0, 1.0]] {
                let inwards = [corner[0] * 0.999_999 + 1.5e-6, corner[1] * 0.999_999 + 0.5e-6];
                assert!(fill.locate(inwards, [3.0, 1.0], 0.7).is_some(), "{degrees} degrees, {corner:?}");
            }
        }
    }
}
