//! Seeded textures: the training and test images of the painters, the same numbers on every machine.

mod noise;
mod scene;
mod texture;

pub use noise::{fbm, lattice, value_noise};
pub use scene::scene;
pub use texture::Texture;
