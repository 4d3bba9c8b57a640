//! Times, printed and not judged: `cargo test --release -p tsdf-hash --test it -- --ignored --nocapture`.

use nalgebra::{Isometry3, Point3};
use tsdf_hash::{ArrivalSettings, ArrivalView, CastSettings, Map, MeshKeeper, Settings, Tiers, View};

use crate::scene::room;
use crate::tiers::{add, colour_view, colours};

/// Milliseconds that this thread has run.
fn thread_ms() -> f64 {
    let text = std::fs::read_to_string("/proc/thread-self/schedstat").unwrap();
    text.split(' ').next().unwrap().parse::<f64>().unwrap() * 1e-6
}

pub(crate) fn timed<T>(work: impl FnOnce() -> T) -> (T, f64) {
    let start = thread_ms();
    let result = work();
    (result, thread_ms() - start)
}

pub(crate) fn median(times: &mut [f64]) -> f64 {
    times.sort_by(f64::total_cmp);
    times[times.len() / 2]
}

#[test]
#[ignore = "prints times"]
fn meshes_of_the_room_at_one_centimetre() {
    let mut map = Map::new(Settings::default()).unwrap();
    let mut keeper = MeshKeeper::new();
    let (mut fusions, mut updates) = (Vec::new(), Vec::new());
    let (mut changed, mut rebuilt) = (0, 0);
    for shot in room::tour(60, 1, &Isometry3::identity()) {
        fusions.push(timed(|| add(&mut map, &shot).unwrap()).1);
        let (report, time) = timed(|| keeper.update(&map).unwrap());
        updates.push(time);
        changed += report.changed;
        rebuilt += report.rebuilt;
    }
    let worst = updates.iter().copied().fold(0.0, f64::max);
    let (changed, rebuilt) = (changed / 60, rebuilt / 60);
    let mean = updates.iter().sum::<f64>() / 60.0;
    println!("fusion {:.2} ms", median(&mut fusions));
    println!("update {:.2} ms (mean {mean:.2}, worst {worst:.2})", median(&mut updates));
    println!("{changed} blocks changed and {rebuilt} rebuilt per frame, {} in all", map.blocks());
    let mut times = [0; 5].map(|_| timed(|| keeper.mesh()).1);
    println!("welding {:.1} ms", median(&mut times));
    let mut times = [0; 5].map(|_| timed(|| map.mesh()).1);
    let mesh = map.mesh();
    let (vertices, faces) = (mesh.positions.len(), mesh.faces.len());
    println!("full mesh {:.1} ms, {vertices} vertices, {faces} faces", median(&mut times));
    assert_eq!(keeper.mesh(), mesh);
}

#[test]
#[ignore = "prints times"]
fn views_of_the_room_at_one_centimetre() {
    let tiers = Tiers { host_bytes: 64 << 20, age: 1.0, hold: f64::MAX, transfers: 200, ..Tiers::default() };
    let mut map = Map::new(Settings { tiers, ..Settings::default() }).unwrap();
    let shots = room::tour(60, 1, &Isometry3::identity());
    // Around twice, half a second between frames: all that is seen in the second round has left.
    let mut old = ArrivalView::new(ArrivalSettings::default()).unwrap();
    let mut times = [const { Vec::new() }; 3];
    let mut cast = View::new();
    for (k, shot) in shots.iter().chain(&shots[..20]).enumerate() {
        map.integrate_at(k as f64 * 0.5, &shot.view(), None, &shot.world_from_camera).unwrap();
        let (camera, pose, next) = (&shot.intrinsics, &shot.world_from_camera, &shots[(k + 1) % 60].world_from_camera);
        let all = CastSettings::default();
        times[0].push(timed(|| map.ray_cast_into(camera, 640, 480, pose, &all, &mut cast).unwrap()).1);
        times[1].push(timed(|| cast.warped(camera, (640, 480), &pose.lerp_slerp(next, 1.0 / 6.0)).unwrap()).1);
        if k >= 60 {
            // Another four frames, in which more of the old blocks arrive.
            for step in 0..4 {
                let pose = pose.lerp_slerp(next, f64::from(step) / 4.0);
                times[2].push(timed(|| old.update(&map.arrivals(), camera, (640, 480), &pose).unwrap()).1);
            }
        }
    }
    println!("blocks held {}, hits {}", map.arrivals().len(), old.view().hits());
    for (name, times) in ["full cast", "warped", "arrivals"].iter().zip(&mut times) {
        println!("{name} {:.2} ms (worst {:.2})", median(times), times[times.len() - 1]);
    }
}

#[test]
#[ignore = "prints times"]
fn distances_in_the_room_at_one_centimetre() {
    let mut map = Map::new(Settings::default()).unwrap();
    for shot in room::tour(60, 1, &Isometry3::identity()) {
        map.integrate(&shot.view(), None, &shot.world_from_camera).unwrap();
    }
    let points: Vec<_> =
        map.mesh().positions.iter().step_by(5).map(|p| Point3::from(p.map(|c| f64::from(c) + 0.013))).collect();
    let mut times = [0; 5].map(|_| timed(|| points.iter().filter_map(|p| map.distance_and_gradient(p)).count()).1);
    let known = points.iter().filter(|p| map.distance_and_gradient(p).is_some()).count();
    let each = 1e6 * median(&mut times) / points.len() as f64;
    println!("distance and gradient {each:.0} ns, {known} of {} known", points.len());
}

/// What a small budget costs: rounds of the room without one and with 8 MiB of active and 64 MiB of host memory, in turns.
#[test]
#[ignore = "prints times"]
fn price_of_eight_mebibytes() {
    let shots = room::tour(60, 1, &Isometry3::identity());
    let tiers = Tiers { host_bytes: 64 << 20, ..Tiers::default() };
    let capped = Settings { max_bytes: 8 << 20, tiers, ..Settings::default() };
    let rgb8 = colours(&shots[0]);
    let mut times = [const { Vec::new() }; 2];
    let mut hashes = Vec::new();
    for round in 0..6 {
        let mut map = Map::new([Settings::default(), capped][round % 2]).unwrap();
        for shot in &shots {
            let (depth, colour, pose) = (shot.view(), colour_view(shot, &rgb8), &shot.world_from_camera);
            times[round % 2].push(timed(|| map.integrate(&depth, Some(&colour), pose).unwrap()).1);
        }
        hashes.push(map.hash());
        if round < 2 {
            println!("{:?}", map.memory());
        }
    }
    let [free, capped] = times.map(|mut times| {
        let sum: f64 = times.iter().sum();
        let middle = median(&mut times);
        let late = times[times.len() * 99 / 100];
        println!("median {middle:.2} ms, p99 {late:.2} ms ({:.2} medians), sum {sum:.0} ms", late / middle);
        [middle, sum]
    });
    println!("ratio of medians {:.3}, of sums {:.3}", capped[0] / free[0], capped[1] / free[1]);
    assert!(hashes.iter().all(|&hash| hash == hashes[0]));
}
