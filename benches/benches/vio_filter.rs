//! The odometry filter: a sample, an output with covariance, an image. The body stands still and is not told so, which
//! costs what motion costs: every landmark is propagated, aligned and used.

use nalgebra::{Isometry3, Vector3};
use paintcopter_benches::{Rng, criterion};
use vio_ekf::filter::{LandmarkSettings, StationarySettings};
use vio_ekf::inertial::{InitialSigma, InitialState};
use vio_ekf::{Camera, Error, ImageView, Imu, ImuNoise, Settings, Stamp, Vio, nalgebra};

const WIDTH: usize = 752;
const HEIGHT: usize = 480;

/// A filter that stands still, its clock, and what it sees.
struct Scene {
    vio: Vio,
    sample: i64,
    pictures: Vec<Vec<u8>>,
}

impl Scene {
    fn new(max_count: usize) -> Result<Self, Error> {
        let stationary = StationarySettings { min_duration_s: f64::INFINITY, ..StationarySettings::default() };
        let mut patches = Settings::default().patches;
        // Room for the many landmarks of the larger scene.
        (patches.min_distance, patches.penalty_distance) = (10.0, 50.0);
        let landmarks = LandmarkSettings { max_count, ..LandmarkSettings::default() };
        let settings = Settings { landmarks, stationary, patches, ..Settings::default() };
        let mut vio = Vio::new(Camera::euroc(), ImuNoise::default(), settings)?;
        vio.imu(&at_rest(0))?;
        vio.initialize(&InitialState {
            stamp: Stamp::from_nanos(0),
            world_from_body: Isometry3::identity(),
            velocity_in_body: Vector3::zeros(),
            gyro_bias: Vector3::zeros(),
            accel_bias: Vector3::zeros(),
            sigma: InitialSigma::default(),
        })?;
        let mut scene = Self { vio, sample: 0, pictures: pictures() };
        for _ in 0..20 {
            scene.frame()?;
        }
        Ok(scene)
    }

    fn samples(&mut self, count: i64) -> Result<(), Error> {
        for _ in 0..count {
            self.sample += 1;
            self.vio.imu(&at_rest(self.sample))?;
        }
        Ok(())
    }

    /// Ten samples and an image; the number of landmarks that it corrected.
    fn frame(&mut self) -> Result<usize, Error> {
        self.samples(10)?;
        let picture = &self.pictures[self.sample as usize / 10 % self.pictures.len()];
        Ok(self.vio.image(at_rest(self.sample).stamp, &ImageView::new(WIDTH, HEIGHT, picture)?)?.used)
    }
}

fn at_rest(sample: i64) -> Imu {
    let accel = Vector3::new(0.0, 0.0, 9.81);
    Imu { stamp: Stamp::from_nanos(sample * 5_000_000), gyro: Vector3::zeros(), accel }
}

/// Grey boxes of all sizes, seen four times with noise of about two grey levels.
fn pictures() -> Vec<Vec<u8>> {
    let mut rng = Rng::new(1);
    let mut picture = vec![100.0; WIDTH * HEIGHT];
    for _ in 0..1500 {
        let (x, y) = (rng.between(0.0, WIDTH as f64) as usize, rng.between(0.0, HEIGHT as f64) as usize);
        let (right, bottom) = (x + rng.between(4.0, 40.0) as usize, y + rng.between(4.0, 40.0) as usize);
        let grey = rng.between(30.0, 220.0);
        for row in y..bottom.min(HEIGHT) {
            picture[row * WIDTH + x..row * WIDTH + right.min(WIDTH)].fill(grey);
        }
    }
    (0..4).map(|_| picture.iter().map(|grey| (grey + rng.between(-3.5, 3.5)).round() as u8).collect()).collect()
}

fn main() -> Result<(), Error> {
    let mut criterion = criterion();
    let mut group = criterion.benchmark_group("vio-ekf filter");
    let mut scene = Scene::new(25)?;
    // Without images the filter moves on by itself when its memory is full, once in a hundred samples: that is in the mean.
    group.bench_function("sample", |b| b.iter(|| scene.samples(1)));
    group.bench_function("sample, and an output with covariance", |b| {
        b.iter(|| scene.samples(1).map(|()| scene.vio.output()));
    });
    for features in [25, 50, 100, 200] {
        let mut scene = Scene::new(features)?;
        let tracked = scene.vio.landmarks().count();
        group.bench_function(format!("10 samples and an image, {tracked} landmarks"), |b| b.iter(|| scene.frame()));
    }
    group.finish();
    criterion.final_summary();
    Ok(())
}
