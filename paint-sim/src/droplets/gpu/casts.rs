//! Nozzles as a GPU takes them: the processor finds the faces that each cone may touch, the GPU casts the droplets.

use super::super::candidate::Candidate;
use super::super::cone::Cone;
use super::super::directions::Droplets;
use super::super::sweep::Nozzle;
use super::super::texel_surface::TexelSurface;
use crate::gpu::{floats, words};

/// What every program on droplets begins with: bindings, and how a droplet finds its texel.
const CAST: &str = include_str!("cast.wgsl");
/// Floats of a packed candidate: six groups of four.
const FLOATS: usize = 24;

/// The source of a program that stands behind `cast.wgsl`.
pub(super) fn source(program: &str) -> String {
    format!("{CAST}\n{program}")
}

/// Slopes of all droplets, as a buffer.
pub(super) fn slopes<'a>(sets: impl IntoIterator<Item = &'a Droplets>) -> Vec<u8> {
    floats(&sets.into_iter().flat_map(Droplets::slopes).flatten().collect::<Vec<f32>>())
}

/// The buffers of a batch of nozzles.
#[derive(Default)]
pub(super) struct Casts {
    candidates: Vec<f32>,
    places: Vec<u32>,
}

impl Casts {
    /// Adds a nozzle that casts `droplets`, whose first one has the number `first_droplet` among all; `word` is for the program.
    pub(super) fn push(
        &mut self,
        surface: &TexelSurface,
        nozzle: &Nozzle,
        droplets: &Droplets,
        word: u32,
        first_droplet: u32,
    ) {
        let Self { candidates, places } = self;
        let (rotation, first) = (nozzle.rotation(), candidates.len() / FLOATS);
        surface.faces_in(&Cone::new(nozzle, droplets), |face| {
            if let Some(candidate) = Candidate::new(face, &rotation, &nozzle.origin.coords) {
                candidates.extend(packed(&candidate));
            }
        });
        let count = candidates.len() / FLOATS - first;
        places.extend([first as u32, count as u32, word, first_droplet]);
    }

    /// Candidates and places.
    pub(super) fn buffers(mut self) -> [Vec<u8>; 2] {
        // A buffer holds at least something.
        self.candidates.resize(self.candidates.len().max(FLOATS), 0.0);
        [floats(&self.candidates), words(&self.places)]
    }
}

/// The uniform of a program.
pub(super) fn settings(surface: &TexelSurface, droplets: &Droplets, literal: bool) -> Vec<u8> {
    words(&[
        droplets.len() as u32,
        surface.width() as u32,
        surface.height() as u32,
        u32::from(literal),
        ((1.0 / droplets.range) as f32).to_bits(),
        0,
        0,
        0,
    ])
}

/// Edge forms, their sum and the texel forms, each with one more number behind it.
fn packed(c: &Candidate) -> [f32; FLOATS] {
    let [a, b, e] = c.edges;
    let [u, v] = c.texel;
    let rows =
        [(a, c.determinant), (b, c.height), (e, f32::from(u8::from(c.painted))), (c.sum, 0.0), (u, 0.0), (v, 0.0)];
    let mut packed = [0.0; FLOATS];
    for (group, (form, more)) in packed.chunks_mut(4).zip(rows) {
        group[..3].copy_from_slice(&form);
        group[3] = more;
    }
    packed
}
