//! A design without a network.

use std::path::{Path, PathBuf};
use std::time::{Duration, Instant};

use nalgebra::Point3;
use serde_json::{Value, json};

use super::estimator::{Estimator, Found, Job, coarse};
use super::session::{DesignSession, Handled, ShownSurface};
use super::worker::Worker;
use crate::cancellation::Cancellation;
use crate::mesh_frame::MeshScale;
use crate::mesh_placement::UpAxis;
use crate::mission::{MissionSettings, preview_picture};
use crate::mission_file::MissionFile;
use crate::pictures::Rgb;

/// A wall of 1.6 x 1 m that faces -x, and one beside it at a right angle.
const WALLS: &str = "v 0 0.8 0.5\nv 0 -0.8 0.5\nv 0 -0.8 1.5\nv 0 0.8 1.5\nv 1 -0.8 0.5\nv 1 -0.8 1.5\nf 1 2 3\nf 1 3 4\nf 2 5 6\nf 2 6 3\n";

/// A folder with the walls, gone with its owner.
struct Scratch(PathBuf);

impl Scratch {
    fn new(name: &str) -> Self {
        let folder = std::env::temp_dir().join(format!("paintcopter-{name}-{}", std::process::id()));
        std::fs::create_dir_all(&folder).unwrap();
        std::fs::write(folder.join("walls.obj"), WALLS).unwrap();
        let red = |k: usize| if k % 40 < 20 { [210, 40, 30] } else { [30, 70, 190] };
        Rgb::from_pixels(40, 30, (0..1200).map(red)).save(&folder.join("hand.png")).unwrap();
        Self(folder)
    }

    fn mission(&self) -> MissionFile {
        let settings = MissionSettings { texel: 0.05, spot: 0.05, threads: 1, ..MissionSettings::default() };
        let mesh = Some(self.0.join("walls.obj"));
        let scale = Some(MeshScale::Factor(1.0));
        MissionFile { mesh, scale, up: Some(UpAxis::Z), settings, ..MissionFile::default() }
    }

    fn session(&self) -> DesignSession {
        DesignSession::new(self.mission(), &self.0.join("out")).unwrap()
    }

    fn picture(&self) -> Vec<u8> {
        picture_message(1, "sun.png", &std::fs::read(self.0.join("hand.png")).unwrap())
    }
}

impl Drop for Scratch {
    fn drop(&mut self) {
        let _ = std::fs::remove_dir_all(&self.0);
    }
}

fn picture_message(number: u64, name: &str, bytes: &[u8]) -> Vec<u8> {
    let head = json!({ "number": number, "name": name }).to_string();
    [&(head.len() as u32).to_le_bytes(), head.as_bytes(), bytes].concat()
}

fn say(session: &mut DesignSession, number: u64, change: &Value) -> Handled {
    session.handle(&json!({ "number": number, "change": change }).to_string()).unwrap()
}

/// Estimates the design; the heads of the estimates, and the texels of the last.
fn estimate(estimator: &mut Estimator, session: &mut DesignSession) -> (Vec<Value>, Vec<u8>) {
    let mut found = Vec::new();
    let job = Job { number: session.number(), mission: session.mission() };
    estimator.estimate(&job, &Cancellation::default(), &mut |what| found.push(what)).unwrap();
    let (mut heads, mut texels) = (Vec::new(), Vec::new());
    for what in found {
        match what {
            Found::Surface { shown, .. } => session.show(shown),
            Found::Known { mission } => session.accept_parts(&mission),
            Found::Estimate { bytes, .. } => {
                let end = 8 + u32::from_le_bytes(bytes[4..8].try_into().unwrap()) as usize;
                heads.push(serde_json::from_slice(&bytes[8..end]).unwrap());
                texels = bytes[end..].to_vec();
            }
            Found::NoSurface { text } | Found::Failed { text } => heads.push(json!({ "error": text })),
        }
    }
    (heads, texels)
}

/// The front wall chosen by a click, with a picture on it.
fn designed(scratch: &Scratch, estimator: &mut Estimator) -> DesignSession {
    let mut session = scratch.session();
    estimate(estimator, &mut session);
    let shown = session.shown().unwrap();
    let part = json!({ "kind": "pick", "point": in_world(&shown, [0.0, 0.3, 0.8]) });
    say(&mut session, 1, &json!({ "do": "region", "surface": shown.number, "part": part }));
    estimate(estimator, &mut session);
    session.handle_picture(&scratch.picture()).unwrap();
    session
}

fn in_world(shown: &ShownSurface, point: [f64; 3]) -> [f64; 3] {
    shown.world_from_mesh.transform_point(&Point3::from(point)).coords.into()
}

/// What the page writes is previewed as what a person writes, byte for byte; and the page has told the same.
#[test]
fn the_mission_of_the_page_is_that_by_hand() {
    let scratch = Scratch::new("design-hand");
    let mut estimator = Estimator::default();
    let mut session = designed(&scratch, &mut estimator);
    say(&mut session, 2, &json!({ "do": "place", "offset": [0.2, -0.1], "size": 0.75, "rotate": 0.25 }));
    say(&mut session, 3, &json!({ "do": "palette", "name": "spot:3" }));
    say(&mut session, 4, &json!({ "do": "wall", "name": "white" }));
    let (heads, texels) = estimate(&mut estimator, &mut session);
    let Handled::Written(written) = say(&mut session, 5, &json!({ "do": "write" })) else { panic!() };

    let by_hand = scratch.0.join("hand.toml");
    let text = "mesh = \"walls.obj\"\nscale = 1.0\nup = \"z\"\ndesign = \"hand.png\"\nregion = \"pick:0,-0.5,1.2\"\npalette = \"spot:3\"\n\
                wall = \"white\"\n[settings]\ntexel = 0.05\nspot = 0.05\n[settings.placement]\nsize = 0.75\noffset = [0.2, -0.1]\nrotate = 0.25\n";
    std::fs::write(&by_hand, text).unwrap();
    let preview = |mission: &Path, folder: &str| {
        let folder = scratch.0.join(folder);
        std::fs::create_dir_all(&folder).unwrap();
        let tasks = MissionFile::read(mission).unwrap().decide_coats(&folder).unwrap();
        let figures = preview_picture(&tasks, &folder).unwrap().unwrap();
        let files = ["expected.png", "wanted.png", "out_of_gamut.png", "report.json"];
        (figures, files.map(|name| std::fs::read(folder.join(name)).unwrap()))
    };
    let (figures, page) = preview(&written, "page");
    let (_, hand) = preview(&by_hand, "hand");
    assert!(page == hand, "{figures:?}");

    // 1.6 m² in texels of 5 cm are not coarser than they are.
    let [head] = &heads[..] else { panic!("{heads:?}") };
    assert_eq!((&head["own"], &head["number"]), (&json!(true), &json!(4)));
    assert_eq!(head["flight_time_s"], json!(figures.flight_time_s));
    assert_eq!(head["mission_time_s"], json!(figures.mission_time_s));
    assert_eq!(head["out_of_gamut_share"], json!(figures.out_of_gamut_share));
    let names: Vec<&str> = head["paints"].as_array().unwrap().iter().map(|p| p["name"].as_str().unwrap()).collect();
    assert_eq!(names, figures.paints);
    let expected = image::load_from_memory(&page[0]).unwrap().to_rgb8();
    let width = head["texels"][0].as_u64().unwrap() as u32;
    let enlarged = expected.width() / width;
    assert_eq!(texels.len() as u32, 4 * expected.width() * expected.height() / enlarged.pow(2));
    for (k, texel) in texels.chunks(4).enumerate().filter(|(_, texel)| texel[3] > 0) {
        let [x, y] = [k as u32 % width, k as u32 / width].map(|c| enlarged * c);
        assert_eq!(expected.get_pixel(x, y).0, texel[..3], "{x} {y}");
    }
}

/// A disc about a click stays clean: its texels are those within its radius of the point, to the width of a texel; then nothing wanted lies there.
#[test]
fn what_is_marked_stays_clean_and_can_be_taken_back() {
    let scratch = Scratch::new("design-clean");
    let mut estimator = Estimator::default();
    let mut session = designed(&scratch, &mut estimator);
    let shown = session.shown().unwrap();
    let part = json!({ "kind": "disc", "point": in_world(&shown, [0.0, 0.0, 1.0]), "normal": [-1.0, 0.0, 0.0], "radius": 0.3 });
    say(&mut session, 5, &json!({ "do": "keep_clean", "surface": shown.number, "part": part }));
    let (heads, texels) = estimate(&mut estimator, &mut session);
    let clean = texels.chunks(4).filter(|texel| texel[3] == 170).count() as f64 * 0.05 * 0.05;
    assert!((clean / (std::f64::consts::PI * 0.09) - 1.0).abs() < 0.1, "{clean} m²");
    // Three deviations of a spot and more inside the disc the wall looks as it did.
    let bare = estimate(&mut Estimator::default(), &mut scratch.session()).1;
    let wall = &bare.chunks(4).find(|texel| texel[3] == 255).unwrap()[..3];
    let width = heads[0]["texels"][0].as_u64().unwrap() as usize;
    let off = |k: usize| [(k % width) as f64 * 0.05 - 0.775, (k / width) as f64 * 0.05 - 0.475];
    let inside = texels.chunks(4).enumerate().filter(|(k, _)| off(*k)[0].hypot(off(*k)[1]) < 0.13);
    let differences = inside.map(|(_, texel)| (0..3).map(|c| texel[c].abs_diff(wall[c])).max().unwrap());
    let differences: Vec<u8> = differences.collect();
    assert!(differences.len() > 12 && differences.iter().all(|d| *d < 6), "{differences:?}");

    // All of it kept clean is no surface to paint: the disc stays, the rest is taken back.
    let all = json!({ "kind": "disc", "point": in_world(&session.shown().unwrap(), [0.0, 0.0, 1.0]), "normal": [-1.0, 0.0, 0.0], "radius": 50.0 });
    let number = session.shown().unwrap().number;
    say(&mut session, 6, &json!({ "do": "keep_clean", "surface": number, "part": all }));
    let (heads, _) = estimate(&mut estimator, &mut session);
    assert!(heads[0]["error"].as_str().unwrap().contains("nothing of the mesh is left"), "{heads:?}");
    assert!(session.take_back_parts() && !session.take_back_parts());
    assert_eq!(session.state().keep_clean.len(), 1);
    say(&mut session, 7, &json!({ "do": "undo_clean" }));
    assert!(session.mission().keep_clean.is_empty());
}

/// Whatever the file's units, axes and place, a click is a point of the file.
#[test]
fn clicks_are_in_the_coordinates_of_the_file() {
    let scratch = Scratch::new("design-frame");
    for (scale, up, region) in [(1.0, UpAxis::Z, None), (0.5, UpAxis::Y, None), (2.0, UpAxis::X, Some("pick:0,0,1"))] {
        let mut mission = scratch.mission();
        (mission.scale, mission.up) = (Some(MeshScale::Factor(scale)), Some(up));
        mission.region = region.map(|region| region.parse().unwrap());
        let scene = mission.read_surface().unwrap().1;
        let file = crate::mesh_io::read_mesh(&scratch.0.join("walls.obj")).unwrap();
        for (placed, file) in scene.canvas.positions.iter().zip(&file.positions) {
            let expected = scene.world_from_mesh.transform_point(&Point3::from(file.map(f64::from)));
            assert!((expected - Point3::from(placed.map(f64::from))).norm() < 1e-5, "{up:?} {placed:?} {expected}");
        }
    }
}

#[test]
fn what_makes_no_sense_is_refused_in_a_line_and_changes_nothing() {
    let scratch = Scratch::new("design-refused");
    let mut session = designed(&scratch, &mut Estimator::default());
    let before = (session.mission(), session.state());
    let number = session.shown().unwrap().number;
    let disc = |radius: f64, normal: [f64; 3]| json!({ "do": "keep_clean", "surface": number, "part": { "kind": "disc", "point": [0, 0, 1], "normal": normal, "radius": radius } });
    let changes = [
        json!({ "do": "place", "offset": [0, 0], "size": 0, "rotate": 0 }),
        json!({ "do": "place", "offset": [1e9, 0], "size": 1, "rotate": 0 }),
        json!({ "do": "place", "offset": [0], "size": 1, "rotate": 0 }),
        json!({ "do": "place", "offset": [0, 0], "size": 1, "rotate": 1e30 }),
        json!({ "do": "place", "offset": [0, 0], "size": 1, "rotate": 0, "more": 1 }),
        json!({ "do": "palette", "name": "/etc/passwd" }),
        json!({ "do": "palette", "name": "spot:99" }),
        json!({ "do": "palette", "name": "one:zebra" }),
        json!({ "do": "wall", "name": "#12" }),
        json!({ "do": "region", "surface": number + 1, "part": { "kind": "pick", "point": [0, 0, 1] } }),
        json!({ "do": "region", "surface": number, "part": { "kind": "pick", "point": [0, 0, 1e30] } }),
        disc(0.0, [-1.0, 0.0, 0.0]),
        disc(0.2, [0.0; 3]),
        json!({ "do": "dance" }),
    ];
    let texts = changes.iter().map(|change| json!({ "number": 9, "change": change }).to_string());
    let raw = [
        "",
        "{",
        "[]",
        "{\"number\":1}",
        "{\"number\":1,\"change\":{\"do\":\"place\",\"offset\":[0,0],\"size\":1e999,\"rotate\":0}}",
    ];
    for text in texts.chain(raw.map(str::to_owned)) {
        let line = session.handle(&text).expect_err(&text).to_string();
        assert!(!line.is_empty() && !line.contains('\n'), "{line}");
        assert!((session.mission(), session.state()) == before, "{text}");
    }
    for bytes in [&b""[..], b"\xff\xff\xff\xff{}", b"\x02\x00\x00\x00{}", &picture_message(9, "a.svg", b"<svg/>")] {
        session.handle_picture(bytes).unwrap_err();
        assert!((session.mission(), session.state()) == before);
    }
    for k in 0..64 {
        say(&mut session, 10 + k, &disc(0.2, [-1.0, 0.0, 0.0]));
    }
    let more = json!({ "number": 99, "change": disc(0.2, [-1.0, 0.0, 0.0]) }).to_string();
    assert!(session.handle(&more).unwrap_err().to_string().contains("64 parts"));
    let bare = scratch.session().handle("{\"number\":1,\"change\":{\"do\":\"write\"}}").unwrap_err();
    assert!(bare.to_string().contains("no picture yet"));
}

#[test]
fn nothing_that_was_there_is_written_over() {
    let scratch = Scratch::new("design-kept");
    let mut session = designed(&scratch, &mut Estimator::default());
    let out = scratch.0.join("out");
    std::fs::create_dir_all(&out).unwrap();
    std::fs::write(out.join("mission.toml"), "mine").unwrap();
    std::fs::write(out.join("sun.png"), "mine too").unwrap();
    for (number, name) in [(5, "mission-2.toml"), (6, "mission-3.toml")] {
        assert_eq!(say(&mut session, number, &json!({ "do": "write" })), Handled::Written(out.join(name)));
        let mission = MissionFile::read(&out.join(name)).unwrap();
        assert_eq!(mission.design, Some(out.join("sun-2.png").display().to_string()));
    }
    assert_eq!(std::fs::read(out.join("mission.toml")).unwrap(), b"mine");
    assert_eq!(std::fs::read(out.join("sun.png")).unwrap(), b"mine too");
    assert_eq!(std::fs::read(out.join("sun-2.png")).unwrap(), std::fs::read(scratch.0.join("hand.png")).unwrap());
    assert_eq!(std::fs::read_dir(&out).unwrap().count(), 5, "nothing else");
}

/// A wall on which the mission's own texels take long: a change overtakes that, and what it overtakes is never told.
#[test]
fn a_newer_design_cancels_an_older_one() {
    let scratch = Scratch::new("design-newer");
    let mut session = designed(&scratch, &mut Estimator::default());
    let job = |session: &DesignSession, texel: f64| {
        let mut mission = session.mission();
        (mission.settings.texel, mission.settings.spot) = (texel, 2.0 * texel);
        Job { number: session.number(), mission }
    };
    let mut worker = Worker::start();
    let wait = |worker: &Worker| worker.found.recv_timeout(Duration::from_mins(2)).unwrap();
    worker.estimate(job(&session, 0.004));
    while !matches!(wait(&worker), Found::Estimate { own: false, .. }) {}
    let begun = Instant::now();
    say(&mut session, 20, &json!({ "do": "place", "offset": [0.1, 0.0], "size": 0.5, "rotate": 0.0 }));
    worker.estimate(job(&session, 0.05));
    let told: Vec<(u64, bool)> = std::iter::repeat_with(|| wait(&worker))
        .filter_map(|found| match found {
            Found::Estimate { number, own, .. } => Some((number, own)),
            _ => None,
        })
        .take(1)
        .collect();
    assert_eq!(told, [(20, true)], "after {:?}", begun.elapsed());
}

/// As many texels as are promised, with rows as near each other as they can be, and never finer than the mission's own.
#[test]
fn a_coarse_estimate_has_few_texels() {
    let own = MissionSettings::default();
    for area in [10.0_f64, 40.0, 1000.0] {
        let found = coarse(&own, area).unwrap();
        let (texels, together) = (area / found.texel.powi(2), found.texel / own.texel);
        // The next finer one would have more.
        assert!(texels <= 3600.0 && area / (found.texel - own.texel).powi(2) > 3600.0, "{texels}");
        assert!((together - together.round()).abs() < 1e-9, "{together}");
        assert!(found.texel > own.texel && found.spot >= own.spot && found.spot >= 0.5 * found.texel);
        assert_eq!((found.limits.spray_spacing, found.limits.row_spacing), (1, 1));
    }
    // 3600 texels of 1.25 cm are 0.56 m².
    assert!(coarse(&own, 0.56).is_none() && coarse(&own, 0.57).is_some() && coarse(&own, f64::NAN).is_none());
}
