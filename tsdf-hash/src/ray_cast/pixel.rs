//! Pixels of a view, and the bands of them that threads fill.

/// Colour of pixels that no colour image has seen.
pub(crate) const UNSEEN: [u8; 3] = [128; 3];

/// One pixel of a view.
#[derive(Clone, Copy)]
pub(crate) struct Pixel {
    pub(crate) depth: f32,
    pub(crate) normal: [f32; 3],
    pub(crate) colour: [u8; 3],
    pub(crate) weight: u16,
}

impl Pixel {
    pub(crate) const NONE: Self = Self { depth: 0.0, normal: [0.0; 3], colour: UNSEEN, weight: 0 };
}

/// Rows of a view that one thread fills, from row `first` on.
pub(crate) struct Band<'a> {
    pub(crate) first: usize,
    pub(crate) depth: &'a mut [f32],
    pub(crate) normals: &'a mut [[f32; 3]],
    pub(crate) colours: &'a mut [[u8; 3]],
    pub(crate) weights: &'a mut [u16],
}

impl Band<'_> {
    pub(crate) fn set(&mut self, at: usize, pixel: &Pixel) {
        self.depth[at] = pixel.depth;
        self.normals[at] = pixel.normal;
        self.colours[at] = pixel.colour;
        self.weights[at] = pixel.weight;
    }
}
