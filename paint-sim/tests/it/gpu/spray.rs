//! Spray on texels: the same paint on every texel, to the femtolitre.

use nalgebra::{Point3, UnitVector3, Vector3};
use paint_sim::surface::GpuOptions;
use paint_sim::surface::GpuSurface;
use paint_sim::{Error, Film, Shot, SprayModel, Texel, TriangleSurface};

use super::{available, options, random};

const SIDE: usize = 48;
/// Width of the rock, m.
const WIDTH: f64 = 0.6;

/// Height of a bumpy rock over the plane z = 0.
fn height(x: f64, y: f64) -> f64 {
    0.03 * (17.0 * x).sin() * (13.0 * y + 1.0).cos() + 0.008 * (71.0 * x + 40.0 * y).sin()
}

/// The rock as a grid of triangles with a plate that hangs before it, somewhere in the world.
pub(super) fn rock(away: [f32; 3]) -> TriangleSurface {
    let at = |k: usize| WIDTH * (k as f64 / SIDE as f64 - 0.5);
    let place = |x: f64, y: f64, z: f64| [x as f32 + away[0], y as f32 + away[1], z as f32 + away[2]];
    let grid = (0..=SIDE).flat_map(|row| (0..=SIDE).map(move |column| (at(column), at(row))));
    let mut positions: Vec<_> = grid.map(|(x, y)| place(x, y, height(x, y))).collect();
    let vertex = |row: usize, column: usize| (row * (SIDE + 1) + column) as u32;
    let cell = |row: usize, column: usize| {
        let [a, b, c, d] =
            [vertex(row, column), vertex(row, column + 1), vertex(row + 1, column + 1), vertex(row + 1, column)];
        [[a, b, c], [a, c, d]]
    };
    let mut faces: Vec<_> = (0..SIDE).flat_map(|row| (0..SIDE).flat_map(move |column| cell(row, column))).collect();
    let plate = positions.len() as u32;
    positions.extend([[0.02, -0.03], [0.11, -0.01], [0.06, 0.07]].map(|[x, y]| place(x, y, 0.09)));
    faces.push([plate, plate + 1, plate + 2]);
    TriangleSurface::new(&positions, &faces).unwrap()
}

/// Texels on the rock, from fine to as large as a spot.
fn texels(away: [f32; 3]) -> Vec<Texel> {
    let offset = Vector3::from(away.map(f64::from));
    let texel = |k: u64| {
        let [x, y] = [2 * k, 2 * k + 1].map(|k| WIDTH * 0.95 * (random(k) - 0.5));
        let step = 1e-5;
        let slope = [height(x + step, y) - height(x - step, y), height(x, y + step) - height(x, y - step)]
            .map(|d| d / (2.0 * step));
        let side = [1e-3, 4e-3, 1.2e-2, 4e-2][(k % 16 / 5) as usize];
        Texel {
            point: Point3::new(x, y, height(x, y) - 2e-4) + offset,
            normal: UnitVector3::new_normalize(Vector3::new(-slope[0], -slope[1], 1.0)),
            area: side * side,
        }
    };
    (0..4000).map(texel).collect()
}

/// Shots from before the rock, some of them slanting, one of nothing and one beside it.
fn shots(away: [f32; 3], count: u64) -> Vec<Shot> {
    let offset = Vector3::from(away.map(f64::from));
    let shot = |k: u64| {
        let part = |place: u64| random(7 * k + place + 1_000_000) - 0.5;
        let beside = if k == 3 { 5.0 } else { 0.0 };
        Shot {
            origin: Point3::new(0.5 * part(0) + beside, 0.5 * part(1), 0.15 + 0.06 * part(2)) + offset,
            axis: UnitVector3::new_normalize(Vector3::new(0.6 * part(3), 0.6 * part(4), -1.0)),
            volume: if k == 5 { 0.0 } else { 2e-7 * (1.0 + part(5)) },
        }
    };
    (0..count).map(shot).collect()
}

fn sprays() -> [SprayModel; 4] {
    let usual = SprayModel::default();
    [
        usual,
        SprayModel { sigma: 0.03, cut: 6.0, efficiency: 0.7, shadow_bias: 0.0, ..usual },
        SprayModel { aspect: 2.5, turn: 0.4, yaw: 0.1, pitch: -0.06, ..usual },
        // Texels up to the nozzle, and thin paint far out.
        SprayModel { sigma: 0.6, cut: 12.0, range: 0.16, ..usual },
    ]
}

#[test]
fn every_texel_has_the_paint_of_the_processor() {
    for (away, most_left) in [([0.0; 3], 0.02), ([3000.0, -20.0, 500.0], 0.05)] {
        let (surface, shots) = (rock(away), shots(away, 40));
        let Some(gpu) = available(GpuSurface::new(&surface, &options())) else { return };
        let mut film = Film::new(texels(away)).unwrap();
        let spray_gpu = film.gpu_spray(&options()).unwrap();
        for (round, spray) in sprays().iter().enumerate() {
            let (mut expected, mut found) = (film.layer(), film.layer());
            let balance = expected.deposit(&shots, spray, &surface, 1, &mut |_, _| ()).unwrap();
            let before = gpu.rays();
            let ours = found.deposit_on(&spray_gpu, &shots, spray, &gpu, 1, &mut |_, _| ()).unwrap();
            let rays = gpu.rays();
            let (asked, left) = (rays.asked - before.asked, rays.left - before.left);
            println!("{away:?} {round}: {left} of {asked} shadow rays left to the processor, {balance:?}");
            assert_eq!(ours, balance, "{round}");
            assert_eq!(found.mass_balance(), expected.mass_balance());
            assert!(found.volumes() == expected.volumes(), "{round}");
            assert!(balance.deposited > 0 && balance.overspray > 0);
            assert!(asked > 1000 && left as f64 <= most_left * asked as f64, "{left} of {asked}");
            // There are shadows.
            let nothing =
                TriangleSurface::new(&[[0.0, 0.0, -9e3], [1.0, 0.0, -9e3], [0.0, 1.0, -9e3]], &[[0, 1, 2]]).unwrap();
            let mut unshaded = film.layer();
            unshaded.deposit(&shots, spray, &nothing, 1, &mut |_, _| ()).unwrap();
            assert!(unshaded.volumes() != found.volumes());
        }
        assert!(spray_gpu.fault().is_none() && !spray_gpu.name().is_empty());
        // The film itself, not a layer of it, and one on other texels.
        film.deposit_on(&spray_gpu, &shots[..1], &sprays()[0], &gpu, 1, &mut |_, _| ()).unwrap();
        let mut other = Film::new(texels(away)).unwrap();
        let refused = other.deposit_on(&spray_gpu, &shots, &sprays()[0], &gpu, 1, &mut |_, _| ());
        assert!(matches!(refused, Err(Error::Gpu { .. })));
    }
}

/// Texels, leaves and rays that no buffer takes at once go in parts; a device that takes none of it leaves the work to the processor.
#[test]
fn large_work_goes_in_parts_and_what_fails_goes_to_the_processor() {
    let (surface, shots, spray) = (rock([0.0; 3]), shots([0.0; 3], 6), SprayModel::default());
    let Some(gpu) = available(GpuSurface::new(&surface, &options())) else { return };
    let film = Film::new(texels([0.0; 3])).unwrap();
    let mut expected = film.layer();
    let balance = expected.deposit(&shots, &spray, &surface, 1, &mut |_, _| ()).unwrap();
    for (most, fails) in [(20_000, false), (1100, true)] {
        let small = GpuOptions { max_buffer_bytes: most, ..options() };
        let spray_gpu = film.gpu_spray(&small).unwrap();
        let mut found = film.layer();
        assert_eq!(found.deposit_on(&spray_gpu, &shots, &spray, &gpu, 2, &mut |_, _| ()).unwrap(), balance);
        assert!(found.volumes() == expected.volumes());
        assert_eq!(spray_gpu.fault().is_some(), fails, "{most}");
    }
    let small = GpuOptions { max_buffer_bytes: 1100, ..options() };
    assert!(matches!(GpuSurface::new(&surface, &small).err(), Some(Error::Gpu { .. })));
}
