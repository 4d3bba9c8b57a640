//! Keyframes: what a place looked like, to find it again, and its depth, to see how far off the present is.

pub(crate) mod bit_stream;
pub(crate) mod compressed_frame;
pub(crate) mod index;
mod keyframe;
pub(crate) mod plane_coder;
mod small_image;
