//! Colours of many stacks of films on a GPU.

use super::film_colours::{Band, FilmColours};
use crate::colour::Srgb8Table;
use crate::error::Error;
use crate::gpu::{GpuOptions, Input, Program, floats, words};

const SOURCE: &str = include_str!("film_colours.wgsl");
/// Places of one work group.
const GROUP: usize = 64;

/// A GPU that knows the paints of a [`FilmColours`], and gives the same colours within 2e-6 of linear sRGB.
///
/// They are not the same bits, as a device may contract products and sums and divides with an error of some units in the last place.
pub struct GpuFilmColours {
    films: FilmColours,
    paints: wgpu::Buffer,
    looks: wgpu::Buffer,
    linear: Program,
    srgb8: Program,
}

impl GpuFilmColours {
    /// Opens an adapter.
    ///
    /// # Errors
    /// [`Error::Gpu`]: there is none, or it refuses.
    pub fn new(films: &FilmColours, options: &GpuOptions) -> Result<Self, Error> {
        let band = |band: &Band| [band.exponent, band.sides[0], band.sides[1], band.scattering];
        let mut paints: Vec<f32> = films.films.iter().flatten().flat_map(band).collect();
        // A buffer holds at least something.
        paints.resize(paints.len().max(4), 0.0);
        let grounds = films.grounds.iter().flat_map(|(ground, [red, green, blue])| [*red, *green, *blue, *ground]);
        let looks: Vec<f32> = grounds.chain(Srgb8Table::get().least()).collect();
        let [linear, srgb8] = [Program::new(options, SOURCE, "linear_srgb")?, Program::new(options, SOURCE, "srgb8")?];
        let [paints, looks] = [linear.keep(&floats(&paints))?, linear.keep(&floats(&looks))?];
        Ok(Self { films: films.clone(), paints, looks, linear, srgb8 })
    }

    /// Name and driver of the adapter.
    pub fn name(&self) -> &str {
        self.linear.adapter()
    }

    /// As [`FilmColours::linear_srgb`].
    ///
    /// # Errors
    /// Also [`Error::Gpu`]: the device failed.
    pub fn linear_srgb(&self, thickness: &[f32], colours: &mut [[f32; 3]]) -> Result<(), Error> {
        self.each(&self.linear, thickness, colours, |words: &[u32; 3]| words.map(f32::from_bits))
    }

    /// As [`FilmColours::srgb8`].
    ///
    /// # Errors
    /// Also [`Error::Gpu`]: the device failed.
    pub fn srgb8(&self, thickness: &[f32], colours: &mut [[u8; 3]]) -> Result<(), Error> {
        self.each(&self.srgb8, thickness, colours, |[word]: &[u32; 1]| [0, 8, 16].map(|shift| (word >> shift) as u8))
    }

    fn each<C, const WORDS: usize>(
        &self,
        program: &Program,
        thickness: &[f32],
        colours: &mut [C],
        of: impl Fn(&[u32; WORDS]) -> C,
    ) -> Result<(), Error> {
        self.films.check(thickness, colours.len())?;
        let (films, places) = (self.films.films.len(), colours.len());
        let most = GROUP * program.most_groups(GROUP * films.max(WORDS));
        for (first, colours) in (0..).step_by(most).zip(colours.chunks_mut(most)) {
            let part = |film: usize| floats(&thickness[film * places + first..][..colours.len()]);
            let mut depths: Vec<u8> = (0..films).flat_map(part).collect();
            depths.resize(depths.len().max(4), 0);
            let uniform = words(&[colours.len() as u32, films as u32, 0, 0]);
            let inputs = [Input::Kept(&self.paints), Input::Kept(&self.looks), Input::Sent(&depths)];
            let found = program.run(&uniform, &inputs, colours.len().div_ceil(GROUP), WORDS * colours.len())?;
            for (colour, words) in colours.iter_mut().zip(found.as_chunks().0) {
                *colour = of(words);
            }
        }
        Ok(())
    }
}
