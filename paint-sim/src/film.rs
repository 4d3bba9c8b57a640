//! The paint on the surface, texel by texel, counted in whole femtolitres.

use std::sync::Arc;

use crate::error::{Error, check_positive, check_range};
#[cfg(feature = "gpu")]
use crate::gpu::GpuOptions;
use crate::spray::{QUANTUM, Shot, SprayModel};
use crate::surface::Surface;
use crate::trace::{event, span};

mod ball_tree;
mod deposit;
mod deposit_each;
#[cfg(feature = "gpu")]
mod gpu_shares;
#[cfg(feature = "gpu")]
mod gpu_spray;
pub mod inspection;
mod mass_balance;
mod texel;
mod texel_index;
mod texel_share;
mod waiting;
pub mod wet;

#[cfg(feature = "gpu")]
pub use gpu_spray::GpuSpray;
pub use mass_balance::MassBalance;
pub use texel::Texel;

use ball_tree::BallTree;
use deposit::{HitList, SHOTS_PER_BATCH, count_quanta, deposit_batch, shot_shares};
use texel::check_unit;
use texel_index::TexelIndex;

/// One layer of paint on a set of texels.
///
/// Several paints are several films on the same texels, see [`Film::layer`].
#[derive(Debug, Clone)]
pub struct Film {
    index: Arc<TexelIndex>,
    volumes: Vec<u64>,
    mass_balance: MassBalance,
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
        let tree = BallTree::new(&texels);
        let volumes = vec![0; texels.len()];
        Ok(Self { index: Arc::new(TexelIndex { texels, tree }), volumes, mass_balance: MassBalance::default() })
    }

    /// An empty film on the same texels: the next paint, or the next coat on a dry one.
    #[must_use]
    pub fn layer(&self) -> Self {
        Self {
            index: Arc::clone(&self.index),
            volumes: vec![0; self.volumes.len()],
            mass_balance: MassBalance::default(),
        }
    }

    /// The texels, in the order in which they were given.
    pub fn texels(&self) -> &[Texel] {
        &self.index.texels
    }

    /// Paint per texel in femtolitres.
    pub fn volumes(&self) -> &[u64] {
        &self.volumes
    }

    /// Thickness of the paint on texel `index`, m; zero where there is no such texel.
    pub fn thickness(&self, index: usize) -> f64 {
        match (self.volumes.get(index), self.index.texels.get(index)) {
            (Some(&volume), Some(texel)) => volume as f64 * QUANTUM / texel.area,
            _ => 0.0,
        }
    }

    /// The mass balance since the film was empty.
    pub fn mass_balance(&self) -> MassBalance {
        self.mass_balance
    }

    /// Sprays `shots` onto the film and returns the mass balance of this call.
    ///
    /// Each texel receives `V * density * area` where the shadow ray from the nozzle to its centre is free; a texel that
    /// is coarse for the spot is integrated by Gauss's rule over a square of its area. If the texels of a shot
    /// together claim more than its share `efficiency` (they are a finite sum), they are scaled down to it. Each shot is
    /// rounded to whole femtolitres by the largest remainder, so the result is the same for every number of `threads`.
    /// `progress(done, total)` is called on the calling thread about every thousand shots.
    ///
    /// # Errors
    /// Shots or settings that are not finite or out of range, no threads, or paint beyond 2^64 femtolitres; the film is
    /// then unchanged.
    pub fn deposit(
        &mut self,
        shots: &[Shot],
        spray: &SprayModel,
        surface: &dyn Surface,
        threads: usize,
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<MassBalance, Error> {
        self.deposit_observed(shots, spray, surface, threads, &mut |_| (), progress)
    }

    /// The same, and tells `touched` every texel that receives paint, some of them more than once: what a live picture has to draw
    /// again.
    ///
    /// # Errors
    /// As [`Film::deposit`].
    pub fn deposit_observed(
        &mut self,
        shots: &[Shot],
        spray: &SprayModel,
        surface: &dyn Surface,
        threads: usize,
        touched: &mut dyn FnMut(u32),
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<MassBalance, Error> {
        self.deposit_told(shots, spray, surface, threads, &mut |texel, _| touched(texel), progress)
    }

    /// The same, and tells `landed` how much comes onto which texel.
    fn deposit_told(
        &mut self,
        shots: &[Shot],
        spray: &SprayModel,
        surface: &dyn Surface,
        threads: usize,
        landed: &mut dyn FnMut(u32, u64),
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<MassBalance, Error> {
        let index = Arc::clone(&self.index);
        let emitted = check_call(shots, spray, threads)?;
        let hits = |batch: &[Shot]| deposit_batch(&index, batch, spray, surface, threads);
        self.deposit_hits(shots, emitted, &hits, landed, progress)
    }

    /// Opens an adapter, and puts the texels of this film there: for it and all its [layers](Film::layer).
    ///
    /// # Errors
    /// [`Error::Gpu`]: there is none, it refuses, or it cannot hold the texels.
    #[cfg(feature = "gpu")]
    pub fn gpu_spray(&self, options: &GpuOptions) -> Result<GpuSpray, Error> {
        GpuSpray::new(&self.index, options)
    }

    /// [`Film::deposit`] with the GPU that knows this film's texels: the same paint on every texel, to the femtolitre, and the same mass
    /// balance. The shadows are those of `surface`, which may be on the GPU as well ([`GpuSurface`](crate::surface::GpuSurface)). Where the GPU
    /// fails the processor goes on with `threads`; [`GpuSpray::fault`] tells.
    ///
    /// # Errors
    /// As [`Film::deposit`], and [`Error::Gpu`] where the GPU knows the texels of another film.
    #[cfg(feature = "gpu")]
    pub fn deposit_on(
        &mut self,
        gpu: &GpuSpray,
        shots: &[Shot],
        spray: &SprayModel,
        surface: &dyn Surface,
        threads: usize,
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<MassBalance, Error> {
        self.deposit_on_told(gpu, (shots, spray, surface), threads, &mut |_, _| (), progress)
    }

    /// The same, and tells `landed` how much comes onto which texel.
    #[cfg(feature = "gpu")]
    fn deposit_on_told(
        &mut self,
        gpu: &GpuSpray,
        (shots, spray, surface): (&[Shot], &SprayModel, &dyn Surface),
        threads: usize,
        landed: &mut dyn FnMut(u32, u64),
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<MassBalance, Error> {
        if !gpu.knows(&self.index) {
            return Err(Error::Gpu { what: "it knows the texels of another film".into() });
        }
        let emitted = check_call(shots, spray, threads)?;
        let hits = |batch: &[Shot]| gpu.deposit_batch(batch, spray, surface, threads);
        self.deposit_hits(shots, emitted, &hits, landed, progress)
    }

    /// Books what `hits` says of every batch.
    fn deposit_hits<S>(
        &mut self,
        shots: &[S],
        emitted: u64,
        hits: &dyn Fn(&[S]) -> HitList,
        landed: &mut dyn FnMut(u32, u64),
        progress: &mut dyn FnMut(usize, usize),
    ) -> Result<MassBalance, Error> {
        span!("deposit");
        self.mass_balance.emitted.checked_add(emitted).ok_or(Error::MassOverflow)?;

        let mut deposited = 0;
        for (number, batch) in shots.chunks(SHOTS_PER_BATCH).enumerate() {
            for (texel, quanta) in hits(batch) {
                self.volumes[texel as usize] += quanta;
                deposited += quanta;
                landed(texel, quanta);
            }
            progress(number * SHOTS_PER_BATCH + batch.len(), shots.len());
        }
        let call = MassBalance { emitted, deposited, overspray: emitted - deposited, dripped: 0 };
        event!(debug, shots = shots.len(), emitted, deposited, overspray = call.overspray, "deposited");
        self.mass_balance.emitted += call.emitted;
        self.mass_balance.deposited += call.deposited;
        self.mass_balance.overspray += call.overspray;
        Ok(call)
    }

    /// Takes back what [`Film::deposit`] has put onto the film for the same shots, settings and surface, to the last femtolitre: where
    /// each shot lands depends on nothing else. Tells `touched` every texel that loses paint.
    ///
    /// # Errors
    /// As [`Film::deposit`], and [`Error::NotDeposited`] where the film holds less than is to be taken back; it is then unchanged.
    pub fn withdraw(
        &mut self,
        shots: &[Shot],
        spray: &SprayModel,
        surface: &dyn Surface,
        threads: usize,
        touched: &mut dyn FnMut(u32),
    ) -> Result<(), Error> {
        let emitted = check_call(shots, spray, threads)?;
        let mut volumes = self.volumes.clone();
        let mut deposited = 0;
        let mut hits = Vec::new();
        for batch in shots.chunks(SHOTS_PER_BATCH) {
            for (texel, quanta) in deposit_batch(&self.index, batch, spray, surface, threads) {
                let volume = &mut volumes[texel as usize];
                *volume = volume.checked_sub(quanta).ok_or(Error::NotDeposited { texel })?;
                deposited += quanta;
                hits.push(texel);
            }
        }
        let balance = &mut self.mass_balance;
        let left = |total: u64, part: u64| total.checked_sub(part).ok_or(Error::NotDeposited { texel: 0 });
        *balance = MassBalance {
            emitted: left(balance.emitted, emitted)?,
            deposited: left(balance.deposited, deposited)?,
            overspray: left(balance.overspray, emitted - deposited)?,
            dripped: balance.dripped,
        };
        self.volumes = volumes;
        hits.into_iter().for_each(touched);
        Ok(())
    }

    /// For every shot the texels that catch some of it, with their shares of its volume: what [`Film::deposit`] puts there before it rounds to
    /// femtolitres. With volumes to be found these are the columns of the matrix by which paint is planned on the surface itself.
    ///
    /// # Errors
    /// As [`Film::deposit`].
    pub fn shares(
        &self,
        shots: &[Shot],
        spray: &SprayModel,
        surface: &dyn Surface,
        threads: usize,
    ) -> Result<Vec<Vec<(u32, f64)>>, Error> {
        span!("shares");
        check_call(shots, spray, threads)?;
        Ok(shot_shares(&self.index, shots, spray, surface, threads))
    }
}

/// Refuses settings out of range; the quanta that the shots emit.
fn check_call(shots: &[Shot], spray: &SprayModel, threads: usize) -> Result<u64, Error> {
    spray.check()?;
    check_range("threads", threads as f64, 1.0, 1024.0, "between 1 and 1024")?;
    count_quanta(shots)
}

/// Sprays `shots` onto bare `texels` in one call; the mass balance is [`Film::mass_balance`]. See [`Film::deposit`] for
/// several coats and for progress.
///
/// # Errors
/// As [`Film::new`] and [`Film::deposit`].
pub fn spray(
    texels: Vec<Texel>,
    shots: &[Shot],
    model: &SprayModel,
    surface: &dyn Surface,
    threads: usize,
) -> Result<Film, Error> {
    let mut film = Film::new(texels)?;
    film.deposit(shots, model, surface, threads, &mut |_, _| ())?;
    Ok(film)
}
