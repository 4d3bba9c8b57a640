//! The directions of the droplets: a Gaussian in slope space, round or elliptic, evenly filled.

use crate::error::{Error, check_range};
use crate::spray::SprayModel;

/// Rays that are cast together; the number of droplets in a set is a multiple of it.
pub(super) const BLOCK: usize = 64;

/// Steps of the two coordinates of Roberts' `R2` sequence (2018): the inverse plastic number and its square.
const STEPS: [f64; 2] = [0.7548776662466927, 0.5698402909980532];

/// Neighbouring droplets: slopes to the left and upwards per metre along the axis, and the box around them.
#[derive(Debug, Clone)]
pub(super) struct Block {
    pub(super) x: [f32; BLOCK],
    pub(super) y: [f32; BLOCK],
    pub(super) low: [f32; 2],
    pub(super) high: [f32; 2],
}

/// A set of droplets that leave the nozzle at once, each with the same share of the paint.
///
/// Their slopes, to the left and upwards of the [`Nozzle`](super::Nozzle), follow the Gaussian of a [`SprayModel`] inside its cone, by the
/// inverse of its distribution over a sequence of low discrepancy. The same number is the same set, and sets of consecutive numbers fill one
/// another's gaps.
#[derive(Debug, Clone)]
pub struct Droplets {
    pub(super) blocks: Vec<Block>,
    pub(super) range: f64,
    /// Tangent of the half opening of a cone around the nozzle's axis that holds them all.
    pub(super) slope: f64,
}

impl Droplets {
    /// Set `number` of `count` droplets each (a multiple of 64).
    ///
    /// # Errors
    /// A count that is no positive multiple of 64, or a spray model out of range.
    pub fn new(spray: &SprayModel, count: usize, number: u64) -> Result<Self, Error> {
        spray.check()?;
        if count == 0 || !count.is_multiple_of(BLOCK) || count > 1 << 20 {
            let allowed = "a multiple of 64 between 64 and 2^20";
            return Err(Error::OutOfRange { what: "number of droplets", value: count as f64, allowed });
        }
        check_range("number of the droplet set", number as f64, 0.0, 1e9, "at most 1e9")?;
        let (deviation, kept) = (spray.sigma.tan(), -(-0.5 * spray.cut * spray.cut).exp_m1());
        let ellipse = spray.ellipse();
        let mut slopes: Vec<[f32; 2]> = (0..count as u64)
            .map(|k| {
                let at = (number * count as u64 + k) as f64 + 1.0;
                let [u, v] = STEPS.map(|step| (0.5 + at * step).fract());
                let radius = deviation * (-2.0 * (-u * kept).ln_1p()).sqrt();
                let (sine, cosine) = (std::f64::consts::TAU * v).sin_cos();
                ellipse.shaped([radius * cosine, radius * sine]).map(|slope| slope as f32)
            })
            .collect();
        group(&mut slopes);
        let blocks = slopes.as_chunks::<BLOCK>().0.iter().map(Block::new).collect();
        Ok(Self { blocks, range: spray.range, slope: ellipse.steepest(spray.cut) })
    }

    /// Sets 0 to `number - 1`: time steps in a row take them in turns.
    ///
    /// # Errors
    /// As [`Self::new`].
    pub fn sets(spray: &SprayModel, count: usize, number: u64) -> Result<Vec<Self>, Error> {
        (0..number).map(|number| Self::new(spray, count, number)).collect()
    }

    /// How many there are.
    pub fn len(&self) -> usize {
        self.blocks.len() * BLOCK
    }

    /// Never: a set has at least 64.
    pub fn is_empty(&self) -> bool {
        self.blocks.is_empty()
    }

    /// Slopes of the droplets: sideways per metre along the axis.
    pub fn slopes(&self) -> impl Iterator<Item = [f32; 2]> + '_ {
        self.blocks.iter().flat_map(|block| block.x.iter().zip(&block.y).map(|(x, y)| [*x, *y]))
    }
}

impl Block {
    fn new(slopes: &[[f32; 2]; BLOCK]) -> Self {
        let bound = |k: usize, pick: fn(f32, f32) -> f32, start: f32| slopes.iter().map(|s| s[k]).fold(start, pick);
        Self {
            x: slopes.map(|s| s[0]),
            y: slopes.map(|s| s[1]),
            low: [0, 1].map(|k| bound(k, f32::min, f32::INFINITY)),
            high: [0, 1].map(|k| bound(k, f32::max, f32::NEG_INFINITY)),
        }
    }
}

/// Orders the slopes so that blocks of 64 are compact: halved along the wider side, again and again.
fn group(slopes: &mut [[f32; 2]]) {
    let blocks = slopes.len() / BLOCK;
    if blocks <= 1 {
        return;
    }
    let extent = |k: usize| {
        let values = || slopes.iter().map(move |s| s[k]);
        values().fold(f32::NEG_INFINITY, f32::max) - values().fold(f32::INFINITY, f32::min)
    };
    let axis = usize::from(extent(1) > extent(0));
    let middle = blocks / 2 * BLOCK;
    slopes.select_nth_unstable_by(middle, |a, b| a[axis].total_cmp(&b[axis]).then(a[1 - axis].total_cmp(&b[1 - axis])));
    let (low, high) = slopes.split_at_mut(middle);
    group(low);
    group(high);
}
