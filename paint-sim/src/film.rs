//! The paint on the surface, texel by texel, counted in whole femtolitres.

use std::sync::Arc;

use nalgebra::{Point3, UnitVector3};

use crate::Error;
use crate::error::check_positive;
use crate::spray::QUANTUM;

mod deposit;
mod tree;

use tree::Tree;

/// A piece of the painted surface.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Texel {
    /// Its centre in the world frame, m.
    pub point: Point3<f64>,
    /// Unit normal of the painted side.
    pub normal: UnitVector3<f64>,
    /// Area of real surface that it stands for, m^2.
    pub area: f64,
}

/// Where the paint went, in quanta of one femtolitre. `emitted == deposited + overspray` always holds.
#[derive(Debug, Clone, Copy, PartialEq, Eq, Default)]
pub struct Books {
    /// Paint that left the nozzle.
    pub emitted: u64,
    /// Paint on the texels.
    pub deposited: u64,
    /// Paint that met no texel.
    pub overspray: u64,
}

impl Books {
    /// Whether nothing was lost or invented.
    pub fn balanced(&self) -> bool {
        self.deposited.checked_add(self.overspray) == Some(self.emitted)
    }
}

/// One layer of paint on a set of texels.
///
/// Several paints are several films on the same texels, see [`Film::layer`].
#[derive(Debug, Clone)]
pub struct Film {
    canvas: Arc<Canvas>,
    volumes: Vec<u64>,
    books: Books,
}

/// The texels and the index over them: shared by all films on one surface.
#[derive(Debug)]
struct Canvas {
    texels: Vec<Texel>,
    tree: Tree,
}

impl Film {
    /// An empty film. Texels need no order and may leave gaps; paint that falls into a gap is overspray.
    ///
    /// # Errors
    /// No texels, more than `u32::MAX`, numbers that are not finite, areas that are not positive, normals not of unit length.
    pub fn new(texels: Vec<Texel>) -> Result<Self, Error> {
        if texels.is_empty() {
            return Err(Error::Empty { what: "texels" });
        }
        if u32::try_from(texels.len()).is_err() {
            let value = texels.len() as f64;
            return Err(Error::OutOfRange { what: "number of texels", value, allowed: "at most 2^32 - 1" });
        }
        for (index, texel) in texels.iter().enumerate() {
            if !(texel.point.iter().chain(texel.normal.iter()).all(|v| v.is_finite()) && texel.area.is_finite()) {
                return Err(Error::NotFinite { what: "texel", index });
            }
            check_positive("texel area", texel.area)?;
            check_unit("length of a texel normal", &texel.normal)?;
        }
        let tree = Tree::new(&texels);
        let volumes = vec![0; texels.len()];
        Ok(Self { canvas: Arc::new(Canvas { texels, tree }), volumes, books: Books::default() })
    }

    /// An empty film on the same texels: the next paint, or the next coat on a dry one.
    #[must_use]
    pub fn layer(&self) -> Self {
        Self { canvas: Arc::clone(&self.canvas), volumes: vec![0; self.volumes.len()], books: Books::default() }
    }

    /// The texels, in the order in which they were given.
    pub fn texels(&self) -> &[Texel] {
        &self.canvas.texels
    }

    /// Paint per texel in femtolitres.
    pub fn volumes(&self) -> &[u64] {
        &self.volumes
    }

    /// Thickness of the paint on texel `index`, m; zero where there is no such texel.
    pub fn thickness(&self, index: usize) -> f64 {
        match (self.volumes.get(index), self.canvas.texels.get(index)) {
            (Some(&volume), Some(texel)) => volume as f64 * QUANTUM / texel.area,
            _ => 0.0,
        }
    }

    /// The books since the film was empty.
    pub fn books(&self) -> Books {
        self.books
    }
}

/// Unit vectors can be built unchecked, and a wrong length would silently scale the paint.
fn check_unit(what: &'static str, vector: &UnitVector3<f64>) -> Result<(), Error> {
    crate::error::check_range(what, vector.norm(), 1.0 - 1e-6, 1.0 + 1e-6, "1 within 1e-6")
}
