//! Unwrapping the rock wall and finding places on it.

use std::error::Error;

use criterion::Throughput;
use paintcopter::world::rock_wall;
use paintcopter_benches::rock::TEXEL;
use paintcopter_benches::{Rng, criterion};
use uv_param::nozzle::{NozzleSettings, nozzle_command};
use uv_param::texture::TexelMap;
use uv_param::{Method, Settings, largest_disk, unwrap};

/// Points looked up.
const POINTS: usize = 100_000;
/// Nozzle poses asked for.
const POSES: usize = 1000;

fn main() -> Result<(), Box<dyn Error>> {
    let mesh = rock_wall(1);
    let positions: Vec<[f64; 3]> = mesh.positions.iter().map(|p| p.map(f64::from)).collect();
    let (disk, _) = largest_disk(&positions, &mesh.faces)?;
    let chart = unwrap(&disk, &Settings::default(), |_| ())?;
    let mut rng = Rng::new(3);
    let places: Vec<[f64; 2]> =
        (0..POINTS).map(|_| [rng.between(0.0, chart.width()), rng.between(0.0, chart.height())]).collect();

    let mut criterion = criterion();
    let mut group = criterion.benchmark_group("uv-param");
    group.bench_function(format!("disk of {} faces", mesh.faces.len()), |b| {
        b.iter(|| largest_disk(&positions, &mesh.faces));
    });
    for method in [Method::Arap, Method::SymmetricDirichlet] {
        let settings = Settings { method, ..Settings::default() };
        unwrap(&disk, &settings, |_| ())?;
        group.bench_function(format!("unwrap {} faces, {method:?}", disk.faces().len()), |b| {
            b.iter(|| unwrap(&disk, &settings, |_| ()));
        });
    }
    TexelMap::new(&chart, TEXEL)?;
    group.bench_function("texel map, 1.25 cm", |b| b.iter(|| TexelMap::new(&chart, TEXEL)));
    group.throughput(Throughput::Elements(POINTS as u64));
    group.bench_function("locate", |b| {
        b.iter(|| places.iter().filter(|at| chart.locate(**at).is_some()).count());
    });
    group.throughput(Throughput::Elements(POSES as u64));
    group.bench_function("nozzle command", |b| {
        let command = |at: &[f64; 2]| nozzle_command(&chart, *at, &NozzleSettings::default()).is_ok();
        b.iter(|| places[..POSES].iter().filter(|at| command(at)).count());
    });
    group.finish();
    criterion.final_summary();
    Ok(())
}
