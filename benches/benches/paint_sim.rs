//! The simulator: paint films, colours, spray, flight and pictures, on the rock and with the main job's settings.

use std::error::Error;
use std::hint::black_box;

use criterion::measurement::WallTime;
use criterion::{BenchmarkGroup, Criterion, Throughput};
use nalgebra::{Point3, Vector3};
use paint_planner::{OptimalPlanner, Planner};
use paint_sim::colour::ciede2000;
use paint_sim::colour::{BANDS, Spectrum, spectrum_srgb8};
use paint_sim::film::wet::{Ground, Side, WetFilm, WetPaint};
use paint_sim::flight::{Reference, ReferenceState};
use paint_sim::render::{Lights, Shading};
use paint_sim::surface::Hit;
use paint_sim::{Camera, Film, FlightSettings, Shot, SprayModel, Texel, TriangleSurface, fly, render};
use paintcopter::adapters::{MeshSurface, PlanReference, Robot, ServoPanTilt};
use paintcopter::mission::MissionSettings;
use paintcopter::surface::PaintSurface;
use paintcopter_benches::films::Films;
use paintcopter_benches::{Rng, criterion, rock};
use ptu_kinematics::Ptu;

type AnyError = Box<dyn Error>;
type Group<'a> = BenchmarkGroup<'a, WallTime>;

/// Films of single precision.
const FILMS: usize = 1_000_000;
/// Films of double precision, and colours.
const FEWER: usize = 100_000;
const SHOTS: usize = 1000;
/// Seconds flown.
const FLOWN: f64 = 10.0;

fn main() -> Result<(), AnyError> {
    let surface = rock::rock()?;
    let mut criterion: Criterion = criterion();
    let mut group = criterion.benchmark_group("paint-sim");
    films(&mut group)?;
    colours(&mut group);
    deposit(&mut group, &surface)?;
    wet(&mut group)?;
    flight(&mut group, &surface)?;
    picture(&mut group, &surface)?;
    group.finish();
    criterion.final_summary();
    Ok(())
}

/// Kubelka-Munk over 36 bands, and what the eye makes of it.
fn films(group: &mut Group) -> Result<(), AnyError> {
    let films = Films::new(FILMS)?;
    let mut narrow = vec![[0.0_f32; BANDS]; FILMS];
    group.throughput(Throughput::Elements((FILMS * BANDS) as u64));
    group.bench_function("Kubelka-Munk f32, 1e6 films x 36 bands", |b| b.iter(|| films.narrow(black_box(&mut narrow))));
    let mut colours = vec![[0_u8; 3]; FILMS];
    films.srgb8(&mut colours)?;
    group.bench_function("Kubelka-Munk to sRGB, 1e6 films x 36 bands", |b| {
        b.iter(|| films.srgb8(black_box(&mut colours)));
    });
    let mut wide: Vec<Spectrum> = vec![[0.0; BANDS]; FEWER];
    group.throughput(Throughput::Elements((FEWER * BANDS) as u64));
    group.bench_function("Kubelka-Munk f64, 1e5 films x 36 bands", |b| b.iter(|| films.wide(black_box(&mut wide))));
    group.throughput(Throughput::Elements(FEWER as u64));
    group.bench_function("spectrum to sRGB", |b| {
        b.iter(|| wide.iter().map(|s| u32::from(spectrum_srgb8(s).rgb[0])).sum::<u32>());
    });
    Ok(())
}

fn colours(group: &mut Group) {
    let mut rng = Rng::new(4);
    let mut lab = || [rng.between(0.0, 100.0), rng.between(-80.0, 80.0), rng.between(-80.0, 80.0)];
    let pairs: Vec<[[f64; 3]; 2]> = (0..FEWER).map(|_| [lab(), lab()]).collect();
    group.throughput(Throughput::Elements(FEWER as u64));
    group.bench_function("CIEDE2000", |b| b.iter(|| pairs.iter().map(|[x, y]| ciede2000(*x, *y)).sum::<f64>()));
}

fn deposit(group: &mut Group, surface: &PaintSurface) -> Result<(), AnyError> {
    let settings = MissionSettings::default();
    let stand_off = settings.planner.nozzle.stand_off;
    let shot = |t: &paint_planner::Target| Shot {
        origin: t.point + t.normal.into_inner() * stand_off,
        axis: -t.normal,
        volume: t.dose * 0.025,
    };
    let shots: Vec<Shot> = rock::stroke(surface, SHOTS).iter().map(shot).collect();
    let spray = SprayModel { sigma: (settings.spot / stand_off).atan(), cut: 4.0, ..SprayModel::default() };
    let mut film = Film::new(surface.film_texels().0)?;
    film.deposit(&shots, &spray, &surface.world, 1, &mut |_, _| ())?;
    group.throughput(Throughput::Elements(shots.len() as u64));
    group.bench_function(format!("deposit on {} texels", film.texels().len()), |b| {
        b.iter(|| film.deposit(&shots, &spray, &surface.world, 1, &mut |_, _| ()));
    });
    Ok(())
}

/// A second of a million texels of a steep wall, wet everywhere and running.
fn wet(group: &mut Group) -> Result<(), AnyError> {
    const SIDE: u32 = 1000;
    const EDGE: f64 = 2e-3;
    let texel = |row: u32, column: u32| Texel {
        // Not quite along the grid: paint runs over two sides.
        point: Point3::new(0.0, EDGE * f64::from(column), -EDGE * (f64::from(row) + 0.1 * f64::from(column))),
        normal: -Vector3::x_axis(),
        area: EDGE * EDGE,
    };
    let places = || (0..SIDE).flat_map(|row| (0..SIDE).map(move |column| (row, column)));
    let side = |row: u32, column: u32| (row < SIDE && column < SIDE).then(|| SIDE * row + column);
    let beyond = |(row, column): (u32, u32)| {
        let around =
            [(row + 1, column), (row.wrapping_sub(1), column), (row, column + 1), (row, column.wrapping_sub(1))];
        around.map(|(beside, along)| Side { texel: SIDE * row + column, beyond: side(beside, along) })
    };
    let sides: Vec<Side> = places().flat_map(beyond).collect();
    let film = Film::new(places().map(|(row, column)| texel(row, column)).collect())?;
    // So viscous that it is as thick after all of the bench.
    let paint = WetPaint { yield_stress: 1.0, viscosity: 500.0, ..WetPaint::default() };
    let mut film = WetFilm::new(film, &sides, paint, Ground::default())?;
    let far = TriangleSurface::new(&[[1.0, -9.0, -9.0], [1.0, 9.0, -9.0], [1.0, 0.0, 9.0]], &[[0, 2, 1]])?;
    let step = 0.05;
    let shot = |row: i32, column: i32| Shot {
        origin: Point3::new(-0.2, step * f64::from(column), -step * f64::from(row)),
        axis: Vector3::x_axis(),
        volume: step * step * 150e-6 * paint.solids,
    };
    let shots: Vec<Shot> = (-3..48).flat_map(|row| (-3..44).map(move |column| shot(row, column))).collect();
    film.deposit(&shots, &SprayModel::default(), &far, 1, &mut |_, _| ())?;
    group.throughput(Throughput::Elements(u64::from(SIDE * SIDE)));
    group.bench_function("wet step, 1e6 texels that run", |b| b.iter(|| film.step(1.0)));
    if film.share_ran() < 0.9 {
        return Err(format!("only {:.2} of the film runs", film.share_ran()).into());
    }
    Ok(())
}

/// The first seconds of a reference.
struct Beginning<'a>(PlanReference<'a>);

impl Reference for Beginning<'_> {
    fn duration(&self) -> f64 {
        FLOWN
    }

    fn at(&self, t: f64) -> ReferenceState {
        self.0.at(t)
    }
}

/// Ten seconds along a stroke, after two of hover: physics at 1 kHz, control and aim at 100 Hz.
fn flight(group: &mut Group, surface: &PaintSurface) -> Result<(), AnyError> {
    let settings = MissionSettings::default();
    let robot = Robot::new(Ptu::new(settings.ptu)?);
    let targets = rock::stroke(surface, 300);
    let plan = OptimalPlanner::default().plan(&targets, &MeshSurface(&surface.world), &robot, &settings.planner)?;
    let (stand_off, gun_length) = (settings.planner.nozzle.stand_off, settings.ptu.tilt_from_tip.norm());
    let reference = Beginning(PlanReference { plan: &plan, chain: &robot.chain, gun_length, stand_off });
    let mut gun = ServoPanTilt::new(robot.chain.clone(), settings.servo)?;
    let usual = FlightSettings::default();
    fly(&reference, &mut gun, &surface.world, &usual)?;
    group.throughput(Throughput::Elements(FLOWN as u64));
    group.bench_function("closed-loop flight of 10 s", |b| {
        b.iter(|| fly(&reference, &mut gun, &surface.world, &usual));
    });
    Ok(())
}

fn picture(group: &mut Group, surface: &PaintSurface) -> Result<(), AnyError> {
    let size = (640, 480);
    let (eye, middle) = (Point3::new(-5.0, 0.5, 2.6), Point3::new(0.0, 0.0, 2.6));
    let camera = Camera::looking_at(&eye, &middle, &Vector3::z(), 1.0, size)?;
    let shade = |hit: &Hit| Shading::matt([0.5; 3], hit.normal);
    let lights = Lights::default();
    render(&surface.world, &camera, &shade, &lights, 1, 1)?;
    group.throughput(Throughput::Elements(u64::from(size.0 * size.1)));
    group.bench_function("render 640 x 480 with shadows, one thread", |b| {
        b.iter(|| render(&surface.world, &camera, &shade, &lights, 1, 1));
    });
    Ok(())
}
