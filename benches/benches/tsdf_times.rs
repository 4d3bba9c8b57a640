//! Processor times of the mapping steps in the room of `peers/synth_rgbd.py` at 1 cm, frame by frame: the incremental mesh and
//! the distance field, views between ray casts, distance queries, and what a small memory budget costs.
//! `cargo bench -p paintcopter-benches --bench tsdf_times [-- NAME]`.

use nalgebra::Point3;
use paintcopter_benches::Rng;
use paintcopter_benches::cpu::seconds;
use paintcopter_benches::room::{RgbdFrame, distance};
use tsdf_hash::distance_field::{DistanceField, DistanceSettings};
use tsdf_hash::mesh::IncrementalMesher;
use tsdf_hash::ray_cast::{IncrementalRayCast, IncrementalRayCastSettings, RayCastSettings, View};
use tsdf_hash::storage::MemoryLimits;
use tsdf_hash::{Error, Map, Settings};

const TURN: usize = 60;

/// A measurement on some frames.
type Part = fn(&[RgbdFrame]) -> Result<(), Error>;

fn main() -> Result<(), Error> {
    let wanted = std::env::args().skip(1).find(|word| !word.starts_with('-')).unwrap_or_default();
    let shots: Vec<RgbdFrame> = (0..TURN).map(|k| RgbdFrame::take(k, TURN).painted()).collect();
    let parts: [(&str, Part); 5] =
        [("mesh", meshes), ("field", distance_field), ("views", views), ("queries", queries), ("budget", budget)];
    for (name, part) in parts.into_iter().filter(|(name, _)| name.contains(&wanted)) {
        println!("{name}");
        part(&shots)?;
    }
    Ok(())
}

/// Milliseconds of processor time.
fn timed<T>(work: impl FnOnce() -> Result<T, Error>) -> Result<(T, f64), Error> {
    let (result, time) = seconds(work);
    Ok((result?, 1e3 * time))
}

fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

fn add(map: &mut Map, shot: &RgbdFrame) -> Result<(), Error> {
    map.integrate(&shot.view(), shot.colour().as_ref(), &shot.world_from_camera).map(drop)
}

fn room(shots: &[RgbdFrame]) -> Result<Map, Error> {
    let mut map = Map::new(Settings::default())?;
    shots.iter().try_for_each(|shot| add(&mut map, shot))?;
    Ok(map)
}

fn meshes(shots: &[RgbdFrame]) -> Result<(), Error> {
    let (mut map, mut mesher) = (Map::new(Settings::default())?, IncrementalMesher::new());
    let (mut fusions, mut updates) = (Vec::new(), Vec::new());
    let (mut changed, mut rebuilt) = (0, 0);
    for shot in shots {
        fusions.push(timed(|| add(&mut map, shot))?.1);
        let (report, time) = timed(|| mesher.update(&map))?;
        updates.push(time);
        changed += report.changed;
        rebuilt += report.rebuilt;
    }
    let (middle, worst) = (median(&mut updates), updates[updates.len() - 1]);
    println!("  integration {:.2} ms, update {middle:.2} ms (worst {worst:.2})", median(&mut fusions));
    println!("  {} blocks changed and {} rebuilt per frame, {} in all", changed / TURN, rebuilt / TURN, map.blocks());
    let mut times = Vec::new();
    for full in [false, true] {
        times.clear();
        for _ in 0..5 {
            times.push(timed(|| Ok(if full { map.mesh() } else { mesher.mesh() }))?.1);
        }
        println!("  {} {:.1} ms", if full { "full mesh" } else { "welding" }, median(&mut times));
    }
    let mesh = map.mesh();
    println!("  {} vertices, {} faces, equal: {}", mesh.positions.len(), mesh.faces.len(), mesher.mesh() == mesh);
    Ok(())
}

fn distance_field(shots: &[RgbdFrame]) -> Result<(), Error> {
    let mut map = Map::new(Settings::default())?;
    let settings = DistanceSettings { max_distance: 1.0 };
    let mut field = DistanceField::new(&settings)?;
    let (mut updates, mut changed, mut rebuilt) = (Vec::new(), 0, 0);
    for shot in shots {
        add(&mut map, shot)?;
        let (report, time) = timed(|| field.update(&map))?;
        updates.push(time);
        changed += report.changed;
        rebuilt += report.rebuilt;
    }
    let (middle, worst) = (median(&mut updates), updates[updates.len() - 1]);
    println!(
        "  update {middle:.2} ms (worst {worst:.2}), {} blocks changed, {} rebuilt",
        changed / TURN,
        rebuilt / TURN
    );
    let mut fresh = DistanceField::new(&settings)?;
    println!("  from scratch {:.1} ms", timed(|| fresh.update(&map))?.1);
    println!("  {} sites in {} blocks", field.sites().count(), map.blocks());
    let mut rng = Rng::new(1);
    let mut next = || Point3::new(rng.between(-3.0, 3.0), rng.between(-2.0, 2.0), rng.between(0.0, 3.0));
    let points: Vec<_> = (0..20_000).map(|_| next()).collect();
    for (low, high) in [(0.0, 0.1), (0.1, 0.3), (0.3, 0.6), (0.6, 1.0), (1.0, 2.0)] {
        let some: Vec<_> = points.iter().filter(|p| (low..high).contains(&distance(p))).collect();
        let (_, time) = timed(|| Ok(std::hint::black_box(some.iter().filter_map(|p| field.distance(p)).sum::<f64>())))?;
        println!("  {} queries at {low}-{high} m: {:.2} us each", some.len(), 1e3 * time / some.len() as f64);
    }
    Ok(())
}

fn views(shots: &[RgbdFrame]) -> Result<(), Error> {
    let limits = MemoryLimits { host_bytes: 64 << 20, max_age: 1.0, max_transfers: 200, ..MemoryLimits::default() };
    let memory = MemoryLimits { merge_timeout: f64::MAX, ..limits };
    let mut map = Map::new(Settings { memory, ..Settings::default() })?;
    // Around twice, half a second between frames: all that is seen in the second round has been evicted.
    let mut old = IncrementalRayCast::new(IncrementalRayCastSettings::default())?;
    let mut times = [const { Vec::new() }; 3];
    let (mut cast, camera) = (View::new(), RgbdFrame::INTRINSICS);
    for (k, shot) in shots.iter().chain(&shots[..20]).enumerate() {
        map.integrate_at(k as f64 * 0.5, &shot.view(), None, &shot.world_from_camera)?;
        let (pose, next) = (&shot.world_from_camera, &shots[(k + 1) % TURN].world_from_camera);
        let all = RayCastSettings::default();
        times[0].push(timed(|| map.ray_cast_into(&camera, 640, 480, pose, &all, &mut cast))?.1);
        times[1].push(timed(|| cast.warped(&camera, (640, 480), &pose.lerp_slerp(next, 1.0 / 6.0)))?.1);
        if k >= TURN {
            // Another four frames, in which more of the old blocks are reloaded.
            for step in 0..4 {
                let pose = pose.lerp_slerp(next, f64::from(step) / 4.0);
                times[2].push(timed(|| old.update(&map.reloaded_blocks(), &camera, (640, 480), &pose))?.1);
            }
        }
    }
    println!("  {} reloaded blocks, {} hits", map.reloaded_blocks().len(), old.view().hits());
    for (name, times) in ["ray cast", "warped", "incremental ray cast"].iter().zip(&mut times) {
        println!("  {name} {:.2} ms (worst {:.2})", median(times), times[times.len() - 1]);
    }
    Ok(())
}

fn queries(shots: &[RgbdFrame]) -> Result<(), Error> {
    let map = room(shots)?;
    let mesh = map.mesh();
    let near = |p: &[f32; 3]| Point3::from(p.map(|c| f64::from(c) + 0.013));
    let points: Vec<_> = mesh.positions.iter().step_by(5).map(near).collect();
    let mut times = Vec::new();
    let mut known = 0;
    for _ in 0..5 {
        let (count, time) = timed(|| Ok(points.iter().filter_map(|p| map.distance_and_gradient(p)).count()))?;
        times.push(time);
        known = count;
    }
    let each = 1e6 * median(&mut times) / points.len() as f64;
    println!("  distance and gradient {each:.0} ns, {known} of {} known", points.len());
    Ok(())
}

/// What a small budget costs: rounds of the room without one and with 8 MiB of active and 64 MiB of host memory, in turns.
fn budget(shots: &[RgbdFrame]) -> Result<(), Error> {
    let memory = MemoryLimits { host_bytes: 64 << 20, ..MemoryLimits::default() };
    let capped = Settings { max_bytes: 8 << 20, memory, ..Settings::default() };
    let mut times = [const { Vec::new() }; 2];
    let mut hashes = Vec::new();
    for round in 0..6 {
        let mut map = Map::new([Settings::default(), capped][round % 2])?;
        for shot in shots {
            times[round % 2].push(timed(|| add(&mut map, shot))?.1);
        }
        hashes.push(map.hash());
        if round < 2 {
            println!("  {:?}", map.memory());
        }
    }
    let [free, capped] = times.map(|mut times| {
        let sum: f64 = times.iter().sum();
        let middle = median(&mut times);
        let late = times[times.len() * 99 / 100];
        println!("  median {middle:.2} ms, p99 {late:.2} ms ({:.2} medians), sum {sum:.0} ms", late / middle);
        [middle, sum]
    });
    println!("  ratio of medians {:.3}, of sums {:.3}", capped[0] / free[0], capped[1] / free[1]);
    println!("  equal maps: {}", hashes.iter().all(|&hash| hash == hashes[0]));
    Ok(())
}
