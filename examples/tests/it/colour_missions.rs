//! Pictures in colour: separated on the surface, planned, flown and sprayed paint by paint.

use std::path::{Path, PathBuf};

use paint_sim::colour::{BANDS, encode_srgb8, spectrum_linear_srgb};
use paint_sim::paint::PIGMENTS;
use paint_sim::{Paint, Substrate, km};
use paintcopter::mission::{Coats, CoatsFigures, PainterChoice, save_coats};
use paintcopter::mission_file::MissionFile;
use paintcopter::paint_set::read_paints;
use paintcopter::palette_choice::PaletteChoice;
use paintcopter::picture_placement::PlacementMode;
use paintcopter::wall::Wall;

use crate::scratch::Scratch;

const UNIT: f64 = 20e-6;

/// A wall of 0.8 m by 0.5 m, standing.
fn wall(scratch: &Scratch) -> PathBuf {
    scratch.write("wall.obj", "v 0 0 0\nv 0.8 0 0\nv 0.8 0.5 0\nv 0 0.5 0\nf 1 2 3\nf 1 3 4\n");
    scratch.0.join("wall.obj")
}

fn pigment(name: &str) -> Paint {
    PIGMENTS.iter().find(|pigment| pigment.name == name).unwrap().paint(UNIT).unwrap()
}

/// A file with two of the artists' pigments; the yellow by the drawdown that its film would make.
fn two_paints(scratch: &Scratch) -> PathBuf {
    let list = |values: &[f64]| values.iter().map(|v| format!("{v:?}")).collect::<Vec<_>>().join(", ");
    let (yellow, blue) = (pigment("hansa yellow"), pigment("phthalo blue"));
    let over = |ground: f64| -> Vec<f64> {
        (0..BANDS).map(|b| km::reflectance(yellow.absorption()[b], yellow.scattering()[b], UNIT, ground)).collect()
    };
    let per_film = |spectrum: &[f64; BANDS]| spectrum.map(|v| v * UNIT);
    let text = format!(
        "[[paints]]\nname = \"yellow\"\nfilm = 20e-6\ncard = [0.05, 0.9]\nover_black = [{}]\nover_white = [{}]\n\
         [[paints]]\nname = \"blue\"\nfilm = 20e-6\ndensity = 1100\nsolids = 0.5\nabsorption = [{}]\nscattering = [{}]\n",
        list(&over(0.05)),
        list(&over(0.9)),
        list(&per_film(blue.absorption())),
        list(&per_film(blue.scattering()))
    );
    scratch.write("paints.toml", text);
    scratch.0.join("paints.toml")
}

/// A picture whose colours are films of blue under yellow on a white wall: more blue to the right, more yellow to the top.
fn picture_of_films(scratch: &Scratch) -> String {
    films(scratch, &|u, v| [0.5 * u, 0.6 * (1.0 - v)])
}

/// The same with these depths of blue and yellow.
fn films(scratch: &Scratch, depths: &dyn Fn(f64, f64) -> [f64; 2]) -> String {
    let (yellow, blue) = (pigment("hansa yellow"), pigment("phthalo blue"));
    let ground = Wall::White.substrate().unwrap();
    let colour = |x: u32, y: u32| {
        let [below, above] = depths(f64::from(x) / 79.0, f64::from(y) / 49.0);
        let below = blue.over(below * UNIT, &ground).unwrap();
        let wall: Substrate = yellow.over(above * UNIT, &below).unwrap();
        image::Rgb(spectrum_linear_srgb(wall.reflectance()).map(|c| encode_srgb8(c).0))
    };
    let path = scratch.path("films.png");
    image::RgbImage::from_fn(80, 50, colour).save(&path).unwrap();
    path
}

fn mission(scratch: &Scratch, palette: &str) -> MissionFile {
    let mut mission = MissionFile { mesh: Some(wall(scratch)), ..MissionFile::default() };
    mission.scale = Some(paintcopter::mesh_frame::MeshScale::Factor(1.0));
    mission.palette = Some(palette.parse::<PaletteChoice>().unwrap());
    mission.design = Some(picture_of_films(scratch));
    mission.wall = Some(Wall::White);
    mission.settings.placement.mode = PlacementMode::Stretch;
    mission
}

fn fly(mission: &MissionFile, folder: &Path) -> CoatsFigures {
    mission.begin_run(folder, "test").unwrap();
    let coats = Coats::run(mission.decide_coats(folder).unwrap()).unwrap();
    save_coats(&coats, folder).unwrap()
}

/// The picture of films is smooth: of both paints wide rows take less time than equal ones, at the same colours.
#[test]
fn wide_rows_paint_a_smooth_picture_in_less_time_as_well() {
    let s = Scratch::new("wide_rows");
    let mut mission = mission(&s, two_paints(&s).to_str().unwrap());
    mission.settings.threads = 2;
    let equal = fly(&mission, &s.0.join("equal"));
    mission.settings.painter = PainterChoice::AdaptiveRows;
    let wide = fly(&mission, &s.0.join("wide"));
    let [equal_picture, wide_picture] = [&equal, &wide].map(|found| found.picture.clone().unwrap());
    let said = format!("{} s, {equal_picture:?}; {} s, {wide_picture:?}", equal.flight_time_s, wide.flight_time_s);
    let mut times = wide.flight_time_s_by_paint.iter().zip(&equal.flight_time_s_by_paint);
    assert!(times.all(|(wide, equal)| wide < equal) && wide.flight_time_s < 0.8 * equal.flight_time_s, "{said}");
    assert!(wide_picture.ciede2000_in_gamut_mean < equal_picture.ciede2000_in_gamut_mean + 0.2, "{said}");
    assert_eq!((wide.paints.len(), wide.collisions), (2, 0));
}

/// Blue has detail in both directions, yellow is even: only yellow's rows are wide.
#[test]
fn each_paint_has_rows_of_its_own() {
    let s = Scratch::new("own_rows");
    let mut mission = mission(&s, two_paints(&s).to_str().unwrap());
    let wave = |at: f64, waves: f64| (std::f64::consts::TAU * waves * at).sin();
    mission.design = Some(films(&s, &|u, v| [0.3 + 0.25 * wave(u, 7.0) * wave(v, 4.4), 0.5]));
    (mission.settings.threads, mission.settings.painter) = (2, PainterChoice::AdaptiveRows);
    let found = fly(&mission, &s.0.join("out"));
    let time = |name: &str| found.flight_time_s_by_paint[found.paints.iter().position(|p| p == name).unwrap()];
    assert!(time("yellow") < 0.75 * time("blue"), "{found:?}");
}

/// A window in the middle of a picture stays clean, and the picture around it is painted.
#[test]
fn a_window_in_a_picture_stays_clean() {
    let s = Scratch::new("window");
    let mut mission = mission(&s, two_paints(&s).to_str().unwrap());
    mission.settings.threads = 2;
    mission.keep_clean = vec!["box:0.3,0.15,-1,0.5,0.35,1".parse().unwrap()];
    let found = fly(&mission, &s.0.join("out"));
    assert!((found.clean.kept_clean_m2.unwrap() - 0.04).abs() < 0.006, "{found:?}");
    // A spot has a deviation of 2.5 cm: a stroke that ended at the frame would soil a margin as wide, half of the window.
    assert!(found.clean.kept_clean_soiled_share.unwrap() < 0.3, "{found:?}");
    let painted: f64 = found.paint_deposited_kg / 1200.0 / 0.36;
    assert!(found.clean.kept_clean_thickness_mean_m.unwrap() < 0.1 * painted, "{found:?}, {painted} elsewhere");
    // Around the window a seventh of the picture is within two deviations of it, and pales towards it.
    let picture = found.picture.unwrap();
    assert!(picture.ciede2000_in_gamut_mean < 4.0, "{picture:?}");
    let again = MissionFile::read(&s.0.join("out/mission.toml")).unwrap();
    assert_eq!(again.keep_clean, mission.keep_clean);
}

/// Six paints can make any grey in many ways: each lies where it is needed, not all of them everywhere.
#[test]
fn a_grey_picture_does_not_take_all_paints_everywhere() {
    let s = Scratch::new("grey");
    let mut mission = mission(&s, "six");
    let grey = |x: u32, _: u32| image::Luma([40 + 2 * (x as u8)]);
    image::GrayImage::from_fn(80, 50, grey).save(s.path("grey.png")).unwrap();
    mission.design = Some(s.path("grey.png"));
    mission.settings.threads = 2;
    let found = fly(&mission, &s.0.join("out"));
    let picture = found.picture.clone().unwrap();
    let longest = found.flight_time_s_by_paint.iter().copied().fold(0.0, f64::max);
    let paints = found.flight_time_s / longest;
    assert!(paints < 3.5 && picture.ciede2000_in_gamut_mean < 3.0, "{found:?} {picture:?}");
}

/// What films have made, films can make again: the picture lies inside the gamut, and what is flown is near it.
#[test]
fn a_picture_made_of_films_is_painted_in_them() {
    let s = Scratch::new("films");
    let mut mission = mission(&s, two_paints(&s).to_str().unwrap());
    mission.settings.threads = 2;
    let found = fly(&mission, &s.0.join("out"));
    let picture = found.picture.clone().unwrap();
    assert!(picture.out_of_gamut_share < 0.01, "{picture:?}");
    assert!(picture.ciede2000_optimum_mean < 1.0 && picture.ciede2000_in_gamut_mean < 1.6, "{picture:?}");
    assert_eq!((found.paints.len(), found.tool_changes, found.collisions), (2, 1, 0));
    // Half of the blue is water.
    let blue = found.paints.iter().position(|name| name == "blue").unwrap();
    let litres = picture.paint_l_by_paint[blue];
    assert!(litres * 1e-3 * 0.5 * 1100.0 > found.paint_deposited_kg_by_paint[blue], "{litres} {found:?}");
    // Thin films are dry before another tank is mounted.
    assert!((found.mission_time_s - found.flight_time_s - 300.0).abs() < 1e-6);
    for file in ["wanted.png", "painted.png", "painted_view.png", "out_of_gamut.png", "report.json", "mission.toml"] {
        assert!(s.0.join("out").join(file).exists(), "{file} is missing");
    }
    // The bare wall and one picture for each paint, no two of them alike: two rows of two.
    let sheet = image::open(s.path("out/progress.png")).unwrap().to_rgb8();
    let (width, height) = (sheet.width() / 2, sheet.height() / 2);
    let tile =
        |k: u32| image::imageops::crop_imm(&sheet, k % 2 * width, 40 + k / 2 * height, width, height - 60).to_image();
    assert!(tile(0) != tile(1) && tile(1) != tile(2) && tile(0) != tile(2));
    assert!(tile(3).pixels().all(|pixel| pixel.0 == [255; 3]));
    // Again from the file that it left, on one thread.
    let mut again = MissionFile::read(&s.0.join("out/mission.toml")).unwrap();
    again.settings.threads = 1;
    fly(&again, &s.0.join("again"));
    let bytes = |folder: &str| std::fs::read(s.0.join(folder).join("painted.png")).unwrap();
    assert_eq!(bytes("out"), bytes("again"));
}

/// White paint alone cannot be green; the share that it does not show is said.
#[test]
fn what_paints_do_not_show_is_out_of_gamut() {
    let s = Scratch::new("gamut");
    let list = |v: f64| vec![format!("{v:?}"); BANDS].join(", ");
    s.write(
        "white.toml",
        format!(
            "[[paints]]\nname = \"white\"\nfilm = 20e-6\nabsorption = [{}]\nscattering = [{}]\n",
            list(0.0),
            list(2.0)
        ),
    );
    let mut mission = mission(&s, s.0.join("white.toml").to_str().unwrap());
    mission.wall = Some(Wall::Concrete);
    let found = fly(&mission, &s.0.join("out")).picture.unwrap();
    assert!(found.out_of_gamut_share > 0.9, "{found:?}");
}

#[test]
fn paints_that_make_no_sense_are_refused_by_name() {
    let s = Scratch::new("paints");
    let list = |v: f64, count: usize| format!("[{}]", vec![format!("{v:?}"); count].join(", "));
    let spectra = |k: f64, s: f64| format!("absorption = {}\nscattering = {}", list(k, BANDS), list(s, BANDS));
    for (rest, expected) in [
        (format!("film = 2e-5\n{}", spectra(-0.1, 1.0)), "absorption"),
        (format!("film = 2e-5\n{}", spectra(0.0, 0.0)), "neither absorbs nor scatters"),
        (format!("film = 0.0\n{}", spectra(1.0, 1.0)), "thickness"),
        (format!("film = 2e-5\ndensity = 0.0\n{}", spectra(1.0, 1.0)), "density"),
        (format!("film = 2e-5\nsolids = 1.5\n{}", spectra(1.0, 1.0)), "solids"),
        (format!("film = 2e-5\nabsorption = {}\nscattering = {}", list(1.0, 35), list(1.0, BANDS)), "35 values"),
        ("film = 2e-5".into(), "give absorption and scattering"),
        (format!("film = 2e-5\nover_black = {}\nover_white = {}", list(0.6, BANDS), list(0.5, BANDS)), "white"),
    ] {
        s.write("bad.toml", format!("[[paints]]\nname = \"moss\"\n{rest}\n"));
        let error = read_paints(&s.0.join("bad.toml")).unwrap_err().to_string();
        assert!(error.contains("moss") && error.contains(expected), "{error}, expected {expected}");
    }
    s.write("bad.toml", "paints = []\n");
    assert!(read_paints(&s.0.join("bad.toml")).unwrap_err().to_string().contains("no paints"));
    let twice = format!("[[paints]]\nname = \"a\"\nfilm = 1e-5\n{}\n", spectra(1.0, 1.0)).repeat(2);
    s.write("bad.toml", twice);
    assert!(read_paints(&s.0.join("bad.toml")).unwrap_err().to_string().contains("two paints"));
}

#[test]
fn palettes_that_do_not_go_with_the_rest_are_refused() {
    let s = Scratch::new("palette");
    let refused = |change: &dyn Fn(&mut MissionFile)| {
        let mut mission = mission(&s, "six");
        change(&mut mission);
        mission.decide_coats(&s.0).map(|_| ()).unwrap_err().to_string()
    };
    assert!(refused(&|m| m.fill = Some(2e-5)).contains("leave out the coat"));
    assert!(refused(&|m| m.design = Some("stripes".into())).contains("grey"));
    assert!(refused(&|m| m.settings.layered = Some(paint_net::painters::LayerPlanning::Joint)).contains("layers"));
    assert!(refused(&|m| m.palette = Some(PaletteChoice::File("nowhere.toml".into()))).contains("nowhere.toml"));
    assert!(refused(&|m| m.wall = Some(Wall::Mesh)).contains("colours for the wall"));
    assert!(refused(&|m| m.palette = None).contains("belong to a palette"));
    for bad in ["spot:0", "spot:13", "spot:x", ""] {
        assert!(bad.parse::<PaletteChoice>().is_err(), "{bad}");
    }
    for bad in ["blue", "#12345", "#12345g"] {
        assert!(bad.parse::<Wall>().is_err(), "{bad}");
    }
    assert_eq!("#0aff10".parse::<Wall>(), Ok(Wall::Colour([10, 255, 16])));
    assert_eq!(Wall::Colour([10, 255, 16]).to_string(), "#0aff10");
}
