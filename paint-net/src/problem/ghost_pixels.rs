//! Pixels of the picture plane that stand for others: what lies beyond a seam of the surface.

use crate::error::Error;

/// A pixel, and the pixels and weights between which it lies elsewhere.
pub type WeightedPixels = (usize, Vec<(usize, f64)>);

/// Ghost pixels, as in computations on a domain in parts: pixels beside a chart that show what the surface goes on with there. What a spray
/// puts on the plane beyond a seam lies on the surface at the rim of the other side.
#[derive(Debug, Clone, PartialEq, Default)]
pub struct GhostPixels {
    ghosts: Vec<WeightedPixels>,
    rim: Vec<WeightedPixels>,
    size: (usize, usize),
}

impl GhostPixels {
    /// For a picture of `width · height` pixels. `ghosts`: what each shows, pixels that are no ghosts, with weights that sum to 1. `rim`: pixels
    /// that are no ghosts, and between which pixels each lies on the plane of the side beyond the seam, with weights that sum to 1 at most.
    ///
    /// # Errors
    /// [`Error::Ghost`] for the first one that does not.
    pub fn new(
        ghosts: Vec<WeightedPixels>,
        rim: Vec<WeightedPixels>,
        (width, height): (usize, usize),
    ) -> Result<Self, Error> {
        let mut is_ghost = vec![false; width * height];
        for &(ghost, _) in &ghosts {
            let slot = is_ghost.get_mut(ghost).ok_or(Error::Ghost { pixel: ghost, why: "lies outside the picture" })?;
            if std::mem::replace(slot, true) {
                return Err(Error::Ghost { pixel: ghost, why: "is given twice" });
            }
        }
        let share = |weight: f64| (0.0..=1.0).contains(&weight);
        let sum = |sources: &[(usize, f64)]| sources.iter().map(|source| source.1).sum::<f64>();
        for (pixel, sources) in &ghosts {
            let sound = sources.iter().all(|&(k, weight)| is_ghost.get(k) == Some(&false) && share(weight));
            if !sound || (sum(sources) - 1.0).abs() > 1e-6 {
                let why = "must show pixels of the picture that are no ghosts, with weights that sum to 1";
                return Err(Error::Ghost { pixel: *pixel, why });
            }
        }
        for (pixel, sources) in &rim {
            let sound = sources.iter().all(|&(k, weight)| k < is_ghost.len() && share(weight));
            if is_ghost.get(*pixel) != Some(&false) || !sound || sum(sources) > 1.0 + 1e-6 {
                let why = "is no pixel of a rim: it must be no ghost, and lie between pixels of the picture";
                return Err(Error::Ghost { pixel: *pixel, why });
            }
        }
        Ok(Self { ghosts, rim, size: (width, height) })
    }

    /// The ghosts and what they show.
    pub fn ghosts(&self) -> &[WeightedPixels] {
        &self.ghosts
    }

    /// Columns and rows of the picture.
    pub(crate) fn size(&self) -> (usize, usize) {
        self.size
    }

    /// Every ghost shows its sources.
    pub fn gather(&self, image: &mut [f64]) {
        for (ghost, sources) in &self.ghosts {
            image[*ghost] = sources.iter().map(|&(k, weight)| weight * image[k]).sum();
        }
    }

    /// What `deposit`, on the plane, puts onto the rims from beyond their seams.
    pub(crate) fn spill<'a>(&'a self, deposit: &'a [f64]) -> impl Iterator<Item = (usize, f64)> + 'a {
        let from = |sources: &[(usize, f64)]| sources.iter().map(|&(k, weight)| weight * deposit[k]).sum::<f64>();
        self.rim.iter().map(move |(pixel, sources)| (*pixel, from(sources)))
    }

    /// The transpose of adding the spill: every pixel counts for the rims on which it lies.
    pub(crate) fn spill_adjoint(&self, field: &mut [f64]) {
        let at_rim: Vec<f64> = self.rim.iter().map(|(pixel, _)| field[*pixel]).collect();
        for ((_, sources), value) in self.rim.iter().zip(at_rim) {
            for &(k, weight) in sources {
                field[k] += weight * value;
            }
        }
    }

    /// Nothing on any ghost.
    pub(crate) fn clear(&self, image: &mut [f64]) {
        for (ghost, _) in &self.ghosts {
            image[*ghost] = 0.0;
        }
    }
}
