//! Poses of two trajectories paired by their stamps.

use nalgebra::Isometry3;

use crate::error::Error;
use crate::stamp::Stamp;
use crate::trajectory::Trajectory;

/// Which poses of two trajectories belong together.
#[derive(Debug, Clone, Copy, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize), serde(default, deny_unknown_fields))]
pub struct Association {
    /// Largest time difference of a pair in seconds; 0.01 as in `evo`. (OpenVINS uses 0.02, which changes results.)
    pub max_difference_s: f64,
    /// Compare with the reference interpolated at the estimate's time instead of its nearest pose; off as in `evo`. With
    /// fast rotation the nearest pose alone costs tenths of a degree.
    pub interpolate: bool,
}

impl Default for Association {
    fn default() -> Self {
        Self { max_difference_s: 0.01, interpolate: false }
    }
}

/// Poses that belong together, item by item.
#[derive(Debug, Clone, PartialEq)]
pub struct PosePairs {
    /// Time of the estimate's pose.
    pub stamps: Vec<Stamp>,
    /// Indices into the reference and the estimate.
    pub indices: Vec<(usize, usize)>,
    /// Reference poses, `world_from_body`.
    pub reference: Vec<Isometry3<f64>>,
    /// Estimated poses, `world_from_body`.
    pub estimate: Vec<Isometry3<f64>>,
}

impl Association {
    /// Finds the pairs and collects their poses.
    pub fn pair_up(&self, reference: &Trajectory, estimate: &Trajectory) -> Result<PosePairs, Error> {
        let indices = associate(reference.stamps(), estimate.stamps(), self.max_difference_s)?;
        let stamps: Vec<Stamp> = indices.iter().map(|&(_, e)| estimate.stamps()[e]).collect();
        let reference_poses = if self.interpolate {
            let (first, last) = reference.span().ok_or(Error::TooFew { what: "reference poses", got: 0, need: 1 })?;
            // A pair may overhang the reference's ends by the allowed difference: there its end pose stands.
            stamps.iter().map(|&s| reference.pose_at(s.clamp(first, last))).collect::<Result<_, _>>()?
        } else {
            indices.iter().map(|&(r, _)| reference.poses()[r]).collect()
        };
        let estimate_poses = indices.iter().map(|&(_, e)| estimate.poses()[e]).collect();
        Ok(PosePairs { stamps, indices, reference: reference_poses, estimate: estimate_poses })
    }
}

/// Index pairs (reference, estimate) that are nearest in time, at most `max_difference_s` seconds apart.
///
/// Each stamp of the shorter list (of the estimate, if equally long) looks for the nearest of the other, the earlier one
/// if two are equally near: this is `evo`'s rule. Unlike there, no pose is used twice: if two claim the same, the nearer
/// keeps it. Indices increase in both lists. Both lists must strictly increase.
pub fn associate(reference: &[Stamp], estimate: &[Stamp], max_difference_s: f64) -> Result<Vec<(usize, usize)>, Error> {
    if !(max_difference_s >= 0.0 && max_difference_s.is_finite()) {
        let rule = "must be finite and not negative";
        return Err(Error::InvalidSetting { name: "max_difference_s", value: max_difference_s, rule });
    }
    for (what, stamps) in [("reference poses", reference), ("estimated poses", estimate)] {
        if stamps.is_empty() {
            return Err(Error::TooFew { what, got: 0, need: 1 });
        }
        if let Some(before) = stamps.windows(2).position(|w| w[1] <= w[0]) {
            return Err(Error::NotIncreasing {
                index: before + 1,
                previous: stamps[before],
                stamp: stamps[before + 1],
            });
        }
    }
    let max_difference = (max_difference_s * 1e9).round() as u64;
    let swapped = estimate.len() > reference.len();
    let (short, long) = if swapped { (reference, estimate) } else { (estimate, reference) };

    let mut pairs: Vec<(usize, usize)> = Vec::new();
    let mut last_difference = u64::MAX;
    for (index, &stamp) in short.iter().enumerate() {
        let later = long.partition_point(|&s| s <= stamp);
        let candidates = later.saturating_sub(1)..long.len().min(later + 1);
        let Some((nearest, difference)) =
            candidates.map(|i| (i, long[i].nanos().abs_diff(stamp.nanos()))).min_by_key(|&(i, d)| (d, i))
        else {
            continue;
        };
        if difference > max_difference {
            continue;
        }
        match pairs.last_mut() {
            Some(last) if last.1 == nearest => {
                if difference < last_difference {
                    *last = (index, nearest);
                    last_difference = difference;
                }
            }
            _ => {
                pairs.push((index, nearest));
                last_difference = difference;
            }
        }
    }
    if pairs.is_empty() {
        return Err(Error::NoMatches {
            max_difference_s,
            reference_first: reference[0],
            reference_last: reference[reference.len() - 1],
            estimate_first: estimate[0],
            estimate_last: estimate[estimate.len() - 1],
        });
    }
    if !swapped {
        for pair in &mut pairs {
            *pair = (pair.1, pair.0);
        }
    }
    Ok(pairs)
}
