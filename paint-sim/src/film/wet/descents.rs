//! Where paint can run to: the sides of texels that go down.

use super::super::Texel;
use super::wet_paint::WetPaint;
use crate::error::{Error, check_range};
use crate::spray::QUANTUM;

/// One side of a texel.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub struct Side {
    /// The texel.
    pub texel: u32,
    /// The texel beyond the side, also where that lies on another chart; `None` at the rim of the surface. On a grid a texel has four.
    pub beyond: Option<u32>,
}

/// Sides that go down, for every texel.
///
/// Texels are ranked by height, the lowest first: who gives paint in this order gives what he had, as what comes to him comes later. So a
/// step needs no second copy of the film.
#[derive(Debug, Clone)]
pub(super) struct Descents {
    pub(super) ranked: Vec<Ranked>,
    pub(super) downhill: Vec<Downhill>,
    /// Texels at the rim with nothing below: paint hangs there in a bead, then drips.
    pub(super) hanging: Vec<u32>,
}

/// What the flow needs of a texel; single precision, as a pass is bound by memory.
#[derive(Debug, Clone, Copy)]
pub(super) struct Ranked {
    pub(super) texel: u32,
    /// Past the last of its sides in `downhill`; the first is where the one ranked before ends.
    pub(super) end: u32,
    /// Thickness of one quantum, m.
    pub(super) quantum: f32,
    /// Thickness of fresh paint that it carries, m.
    pub(super) sag: f32,
}

/// A side that goes down.
#[derive(Debug, Clone, Copy)]
pub(super) struct Downhill {
    pub(super) to: u32,
    /// Fall of height over the squared distance of the centres, 1/m: a flux per weight times this is the thickness that leaves per time, where the
    /// width of a side is the texel's area over that distance.
    pub(super) fall: f32,
}

impl Descents {
    pub(super) fn new(texels: &[Texel], sides: &[Side], paint: &WetPaint) -> Result<Self, Error> {
        let count = texels.len();
        let known = |texel: u32| {
            let last = count as f64 - 1.0;
            check_range("texel of a side", f64::from(texel), 0.0, last, "the index of a texel of the film")
        };
        for side in sides {
            known(side.texel)?;
            side.beyond.map_or(Ok(()), known)?;
        }
        let height = |texel: u32| texels[texel as usize].point.z;
        let lower = |a: u32, b: u32| height(a).total_cmp(&height(b)).then(a.cmp(&b));
        let mut rank: Vec<u32> = (0..count as u32).collect();
        rank.sort_unstable_by(|&a, &b| lower(a, b));
        let mut own = sides.to_vec();
        own.sort_unstable_by(|a, b| lower(a.texel, b.texel).then(a.beyond.cmp(&b.beyond)));
        let (mut ranked, mut downhill, mut hanging) = (Vec::with_capacity(count), Vec::new(), Vec::new());
        let mut rest = own.into_iter().peekable();
        for texel in rank {
            let here = texels[texel as usize];
            let (before, mut rim) = (downhill.len(), false);
            while let Some(side) = rest.next_if(|side| side.texel == texel) {
                let Some(to) = side.beyond else {
                    rim = true;
                    continue;
                };
                let way = texels[to as usize].point - here.point;
                // Centres on one another: a degenerate texel, which has no way down.
                let fall = -way.z / way.norm_squared();
                if fall > 0.0 && fall.is_finite() {
                    downhill.push(Downhill { to, fall: fall as f32 });
                }
            }
            ranked.push(Ranked {
                texel,
                end: downhill.len() as u32,
                quantum: (QUANTUM / here.area) as f32,
                sag: paint.sag_thickness(&here.normal) as f32,
            });
            if rim && downhill.len() == before {
                hanging.push(texel);
            }
        }
        Ok(Self { ranked, downhill, hanging })
    }
}
