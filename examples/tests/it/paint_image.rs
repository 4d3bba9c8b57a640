//! The binary `paint-image`: files out, bad files in, training in sittings.

use std::path::Path;
use std::process::{Command, Output};

use paint_net::thesis::{Architecture, Network};

use crate::scratch::Scratch;

fn run(arguments: &[&str]) -> Output {
    Command::new(env!("CARGO_BIN_EXE_paint-image")).args(arguments).output().unwrap()
}

fn json(path: &str) -> serde_json::Value {
    serde_json::from_str(&std::fs::read_to_string(path).unwrap()).unwrap()
}

/// The recording holds the sprays of `commands.json` in the same order, at times that suit a nozzle of 100 px/s.
fn assert_recorded(out: &str, sprays: &[serde_json::Value]) {
    let bytes = std::fs::read(format!("{out}/commands.mcap")).unwrap();
    assert!(mcap::Summary::read(&bytes).unwrap().unwrap().channels.values().any(|c| c.topic == "/sprays"));
    let messages: Vec<_> = mcap::MessageStream::new(&bytes).unwrap().map(Result::unwrap).collect();
    assert_eq!(messages.len(), sprays.len());
    let place = |s: &serde_json::Value| [0, 1].map(|k| s[k].as_f64().unwrap());
    let (mut flown, mut last) = (0.0, sprays.first().map(place));
    for (message, spray) in messages.iter().zip(sprays) {
        let schema = message.channel.schema.as_ref().unwrap();
        assert_eq!((schema.name.as_str(), schema.encoding.as_str()), ("paintcopter.Spray", "jsonschema"));
        let json: serde_json::Value = serde_json::from_slice(&message.data).unwrap();
        for (k, key) in ["x_px", "y_px", "volume", "sigma_px", "paint"].iter().enumerate() {
            assert_eq!(json[key], spray[k], "{key}");
        }
        let (from, to) = (last.replace(place(spray)).unwrap(), place(spray));
        flown += (to[0] - from[0]).hypot(to[1] - from[1]);
        assert!((1e-9 * message.log_time as f64 - flown / 100.0).abs() < 1e-6);
    }
}

#[test]
fn a_picture_becomes_commands_pictures_and_figures() {
    let scratch = Scratch::new("paint");
    // 16 bits with transparency: the right half is bare wall whatever its colour.
    let picture = image::ImageBuffer::from_fn(40, 25, |x, y| {
        let grey = 20_000 + 500 * y as u16;
        image::LumaA([grey, if x < 20 { u16::MAX } else { 0 }])
    });
    picture.save(scratch.path("in.png")).unwrap();
    for painter in ["feedback", "closed-loop", "deconvolution", "pursuit", "free-sprays"] {
        let out = scratch.path(painter);
        let output = run(&["--image", &scratch.path("in.png"), "--painter", painter, "--out", &out]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let report = json(&format!("{out}/report.json"));
        for key in [
            "psnr_db",
            "ssim",
            "bce_nats_per_px",
            "ciede2000_mean",
            "sprays",
            "passes",
            "volume_total",
            "slew_violations",
            "cpu_ms",
            "threads",
        ] {
            assert!(report[key].is_number(), "{painter}: {key}");
        }
        let commands = json(&format!("{out}/commands.json"));
        let sprays = commands["sprays"].as_array().unwrap();
        assert_eq!((commands["width"].as_u64(), commands["height"].as_u64()), (Some(40), Some(25)));
        assert_eq!(sprays.len(), report["sprays"].as_u64().unwrap() as usize);
        assert_recorded(&out, sprays);
        // The commands alone give the picture: rendered here by the definition.
        let depth = |x: f64, y: f64| -> f64 {
            let of = |s: &serde_json::Value, k: usize| s[k].as_f64().unwrap();
            let near = |s: &&serde_json::Value| {
                (of(s, 0) - x).abs() <= 2.0 * of(s, 3) && (of(s, 1) - y).abs() <= 2.0 * of(s, 3)
            };
            let gauss = |s: &serde_json::Value| {
                let squared = (of(s, 0) - x).powi(2) + (of(s, 1) - y).powi(2);
                of(s, 2) * (-squared / (2.0 * of(s, 3).powi(2))).exp()
            };
            sprays.iter().filter(near).map(gauss).sum()
        };
        let rendered = image::open(format!("{out}/rendered.png")).unwrap().to_luma8();
        for (x, y) in [(5, 5), (12, 20), (30, 12)] {
            let expected = 255.0 * (1.0 - depth(f64::from(x), f64::from(y)).tanh());
            assert!((f64::from(rendered.get_pixel(x, y).0[0]) - expected).abs() <= 0.6, "{painter} at {x}, {y}");
        }
        assert!(Path::new(&format!("{out}/error.png")).exists());
    }
}

#[test]
fn painters_are_compared_in_a_table_and_side_by_side() {
    let scratch = Scratch::new("compare");
    let folder = scratch.path("pictures");
    std::fs::create_dir(&folder).unwrap();
    // A wide picture that is enlarged, and a high one that is made smaller.
    for (name, width, height) in [("a.png", 64, 32), ("b.png", 40, 300)] {
        let picture = image::GrayImage::from_fn(width, height, |x, y| image::Luma([40 + (x + y / 2) as u8]));
        picture.save(format!("{folder}/{name}")).unwrap();
    }
    let out = scratch.path("out");
    let output = run(&["compare", &folder, "--runs", "1", "--out", &out]);
    assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
    let table = std::fs::read_to_string(format!("{out}/compare.md")).unwrap();
    assert_eq!(table, String::from_utf8(output.stdout).unwrap());
    let rows: Vec<Vec<&str>> = table.lines().map(|l| l.split('|').map(str::trim).collect()).collect();
    assert_eq!(rows.len(), 2 + 7);
    assert!(rows.iter().all(|row| row.len() == rows[0].len()));
    // The row of the first painter is the mean of painting the pictures one by one.
    let alone = |name: &str| {
        assert!(run(&["--image", &format!("{folder}/{name}"), "--out", &out]).status.success());
        json(&format!("{out}/report.json"))["psnr_db"].as_f64().unwrap()
    };
    let mean = 0.5 * (alone("a.png") + alone("b.png"));
    assert_eq!(rows[2][2], format!("{mean:.2}"));
    // Tiles of 256 pixels, 12 apart, 26 for the caption: eight columns, two rows.
    let sheet = image::open(format!("{out}/compare.png")).unwrap().to_luma8();
    assert_eq!(sheet.dimensions(), (12 + 8 * 268, 12 + 166 + 294));
    // The last two are the thesis' network, which knows no such picture.
    for column in 0..6 {
        let left = 12 + 268 * column;
        // Grey 40 + 32 + 16 / 2 in the middle of the first picture (a mean, as the greedy painter speckles), white beside
        // the narrow one.
        let middle = image::imageops::crop_imm(&sheet, left + 96, 12 + 26 + 32, 64, 64).to_image();
        let mean = middle.pixels().map(|p| f64::from(p.0[0])).sum::<f64>() / (64.0 * 64.0);
        assert!((mean - 80.0).abs() < 5.0, "column {column}: {mean}");
        assert_eq!(sheet.get_pixel(left + 100, 12 + 166 + 26 + 128).0[0], 255, "column {column}");
    }
}

#[test]
fn a_slow_valve_is_obeyed() {
    let scratch = Scratch::new("slew");
    image::GrayImage::from_fn(32, 32, |x, _| image::Luma([if x < 16 { 60 } else { 230 }]))
        .save(scratch.path("in.png"))
        .unwrap();
    let out = scratch.path("out");
    let image = scratch.path("in.png");
    let mut quality = Vec::new();
    for order in ["boustrophedon", "context-based"] {
        let output = run(&["--image", &image, "--slew-limit", "0.01", "--scan-order", order, "--out", &out]);
        assert!(output.status.success());
        let report = json(&format!("{out}/report.json"));
        assert_eq!(report["slew_violations"], 0);
        quality.push(report["psnr_db"].as_f64().unwrap());
    }
    assert!(quality[1] > quality[0] + 1.0, "an edge across the rows: {quality:?}");
}

#[test]
fn a_picture_in_colour_becomes_commands_of_every_paint() {
    let scratch = Scratch::new("colour");
    image::RgbImage::from_fn(36, 20, |x, y| image::Rgb([250 - 5 * x as u8, 120 + 6 * y as u8, 200]))
        .save(scratch.path("in.png"))
        .unwrap();
    for (palette, count) in [("cmy", 3), ("six", 6)] {
        let out = scratch.path(palette);
        let output = run(&["--image", &scratch.path("in.png"), "--palette", palette, "--out", &out]);
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let (report, commands) = (json(&format!("{out}/report.json")), json(&format!("{out}/commands.json")));
        assert!(report["ciede2000_mean"].as_f64().unwrap() < 3.0, "{report}");
        assert_eq!(commands["paints"].as_array().unwrap().len(), count);
        assert_luma_figures(&scratch.path("in.png"), &out, &report);
        // The map is drawn, within its axes: not one colour all over.
        let map = image::open(format!("{out}/error.png")).unwrap().to_rgb8();
        let inside = image::imageops::crop_imm(&map, 150, 100, 1000, 500).to_image();
        assert!(inside.pixels().collect::<std::collections::HashSet<_>>().len() > 5);
        let sprays = commands["sprays"].as_array().unwrap();
        assert_eq!(sprays.len() as u64, report["sprays"].as_u64().unwrap());
        assert_recorded(&out, sprays);
        assert!(sprays.iter().all(|s| s[4].as_u64().unwrap() < count as u64));
        // The commands alone give the picture: glazes by Beer and Lambert, rendered here by the definition.
        let rendered = image::open(format!("{out}/rendered.png")).unwrap().to_rgb8();
        let of = |s: &serde_json::Value, k: usize| s[k].as_f64().unwrap();
        for (x, y) in [(5.0, 5.0), (20.0, 11.0)] {
            for band in 0..3 {
                let near = |s: &&serde_json::Value| (of(s, 0) - x).abs() <= 4.0 && (of(s, 1) - y).abs() <= 4.0;
                let absorbed = |s: &serde_json::Value| {
                    let squared = (of(s, 0) - x).powi(2) + (of(s, 1) - y).powi(2);
                    let k =
                        commands["spray_model"]["absorption"][s[4].as_u64().unwrap() as usize][band].as_f64().unwrap();
                    2.0 * k * of(s, 2) * (-squared / (2.0 * of(s, 3).powi(2))).exp()
                };
                let expected = 255.0 * (-sprays.iter().filter(near).map(absorbed).sum::<f64>()).exp();
                let found = f64::from(rendered.get_pixel(x as u32, y as u32).0[band]);
                assert!((found - expected).abs() <= 0.6, "{palette}, band {band}: {found} {expected}");
            }
        }
    }
}

/// Similarity and cross-entropy in colour are those of the lumas, computed here by the definitions.
fn assert_luma_figures(wanted: &str, out: &str, report: &serde_json::Value) {
    let ink = |path: &str| -> (usize, Vec<f64>) {
        let picture = image::open(path).unwrap().to_rgb8();
        let luma =
            |p: &image::Rgb<u8>| 0.2126 * f64::from(p.0[0]) + 0.7152 * f64::from(p.0[1]) + 0.0722 * f64::from(p.0[2]);
        (picture.width() as usize, picture.pixels().map(|p| 1.0 - luma(p) / 255.0).collect())
    };
    let ((width, a), (_, y)) = (ink(&format!("{out}/rendered.png")), ink(wanted));
    let nats = |(&a, &y): (&f64, &f64)| -(y * a.ln() + (1.0 - y) * (1.0 - a).ln());
    let entropy = a.iter().zip(&y).map(nats).sum::<f64>() / a.len() as f64;
    let found = report["bce_nats_per_px"].as_f64().unwrap();
    // The rendered picture is rounded to bytes.
    assert!((found - entropy).abs() < 1e-4, "{found} {entropy}");
    let (mut sum, mut windows) = (0.0, 0.0);
    for top in 0..=a.len() / width - 7 {
        for left in 0..=width - 7 {
            let window = |of: &dyn Fn(usize) -> f64| -> f64 {
                (0..49).map(|k| of((top + k / 7) * width + left + k % 7)).sum::<f64>()
            };
            let (ma, my) = (window(&|k| a[k]) / 49.0, window(&|k| y[k]) / 49.0);
            let covariance = |p: &[f64], mp: f64, q: &[f64], mq: f64| window(&|k| (p[k] - mp) * (q[k] - mq)) / 48.0;
            let (c1, c2) = (0.01_f64.powi(2), 0.03_f64.powi(2));
            sum += (2.0 * ma * my + c1) * (2.0 * covariance(&a, ma, &y, my) + c2)
                / ((ma * ma + my * my + c1) * (covariance(&a, ma, &a, ma) + covariance(&y, my, &y, my) + c2));
            windows += 1.0;
        }
    }
    let found = report["ssim"].as_f64().unwrap();
    assert!((found - sum / windows).abs() < 0.005, "{found} {}", sum / windows);
}

#[test]
fn layers_are_sprayed_one_after_the_other() {
    let scratch = Scratch::new("layers");
    image::GrayImage::from_fn(40, 30, |x, _| image::Luma([250 - 6 * x as u8])).save(scratch.path("in.png")).unwrap();
    let report = |extra: &[&str], out: &str| {
        let image = scratch.path("in.png");
        let output = run(&[&["--image", &image, "--out", out], extra].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        json(&format!("{out}/report.json"))
    };
    let (whole, layers) = (report(&[], &scratch.path("whole")), report(&["--layers"], &scratch.path("layers")));
    let of = |report: &serde_json::Value, key: &str| report[key].as_f64().unwrap();
    assert!(of(&layers, "sprays") > 1.5 * of(&whole, "sprays"), "every layer sprays");
    assert!((of(&layers, "psnr_db") - of(&whole, "psnr_db")).abs() < 0.01, "the layers add up to the whole");
}

#[test]
fn the_network_of_a_file_paints_is_compared_and_paints_in_layers() {
    let scratch = Scratch::new("thesis");
    let picture = scratch.path("in.png");
    image::GrayImage::from_fn(40, 24, |x, _| image::Luma([30 + 5 * x as u8])).save(&picture).unwrap();
    let architecture =
        Architecture { side: 16, steps: 12, latent: 4, hidden: 10, read: 3, radius: 4.0, stop: 9.0, paint: 6 };
    let (weights, out) = (scratch.path("thesis.safetensors"), scratch.path("out"));
    std::fs::write(&weights, Network::random(architecture, 1).unwrap().to_safetensors(&[])).unwrap();
    let sprays = |more: &[&str]| {
        let job = ["--image", &picture, "--painter", "thesis", "--weights", &weights, "--out", &out];
        let output = run(&[&job, more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        let report = json(&format!("{out}/report.json"));
        (report["painter"].as_str().unwrap().to_string(), report["sprays"].as_u64().unwrap())
    };
    let (alone, layered) = (sprays(&[]), sprays(&["--layers=sequential"]));
    assert_eq!((alone.0.as_str(), layered.0.as_str()), ("thesis", "thesis, layers"));
    // Six tiles of at most twelve steps, of which some fall beside the picture; a plan for each layer.
    assert!((1..=6 * 12).contains(&alone.1) && layered.1 > alone.1, "{alone:?} {layered:?}");
    assert!(run(&["compare", &picture, "--runs", "1", "--weights", &weights, "--out", &out]).status.success());
    let table = std::fs::read_to_string(format!("{out}/compare.md")).unwrap();
    let rows: Vec<&str> = table.lines().skip(2).filter_map(|l| l.split('|').nth(1)).map(str::trim).collect();
    assert_eq!(
        rows,
        ["feedback", "closed-loop", "deconvolution", "pursuit", "free-sprays", "thesis", "thesis, layers"]
    );
    for (row, (name, sprays)) in table.lines().skip(7).zip([alone, layered]) {
        let cells: Vec<&str> = row.split('|').map(str::trim).collect();
        assert_eq!((cells[1], cells[5]), (name.as_str(), sprays.to_string().as_str()));
    }
}

#[test]
fn every_picture_of_a_folder_is_painted_and_filmed() {
    let scratch = Scratch::new("folder");
    let folder = scratch.path("pictures");
    std::fs::create_dir(&folder).unwrap();
    for (name, shade) in [("a.png", 100), ("a.jpg", 200)] {
        image::RgbImage::from_fn(64, 64, |x, y| image::Rgb([shade, 60 + (x + y) as u8, 90]))
            .save(format!("{folder}/{name}"))
            .unwrap();
    }
    std::fs::write(format!("{folder}/notes.txt"), "no picture").unwrap();
    for more in [&["--painter", "closed-loop"][..], &["--palette", "cmy"]] {
        let out = scratch.path("out");
        let output = run(&[&["--image", &folder, "--out", &out], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        for name in ["a.png", "a.jpg"] {
            let file = |name_of: &str| image::open(format!("{out}/{name}/{name_of}")).unwrap().to_rgb8();
            assert!(Path::new(&format!("{out}/{name}/report.json")).exists());
            // What is wanted and eight moments, three in a row, in tiles of 256 pixels, 12 apart, below a caption of 26.
            let (sheet, rendered) = (file("progress.png"), file("rendered.png"));
            assert_eq!(sheet.dimensions(), (12 + 3 * 268, 12 + 3 * 294));
            let corner = |k: u32| (12 + k % 3 * 268, 38 + k / 3 * 294);
            let tile = |k: u32| image::imageops::crop_imm(&sheet, corner(k).0, corner(k).1, 256, 256).to_image();
            let difference = |k: u32| {
                let tile = tile(k);
                let pairs = tile.enumerate_pixels().map(|(x, y, p)| (p, rendered.get_pixel(x / 4, y / 4)));
                pairs.map(|(a, b)| (0..3).map(|c| a.0[c].abs_diff(b.0[c])).max().unwrap()).max().unwrap()
            };
            // The last moment is the result; at the first most of it is still bare wall.
            assert!(difference(8) <= 1, "{name} {more:?}: {}", difference(8));
            assert!(difference(1) > 50);
        }
        std::fs::remove_dir_all(&out).unwrap();
    }
}

#[test]
fn a_blank_picture_gets_no_spray() {
    let scratch = Scratch::new("blank");
    image::GrayImage::from_pixel(3, 50, image::Luma([255])).save(scratch.path("in.png")).unwrap();
    let out = scratch.path("out");
    assert!(run(&["--image", &scratch.path("in.png"), "--out", &out]).status.success());
    assert_eq!(json(&format!("{out}/report.json"))["sprays"], 0);
    assert_recorded(&out, &[]);
}

#[test]
fn what_cannot_be_painted_is_named() {
    let scratch = Scratch::new("bad");
    std::fs::write(scratch.path("not.png"), "this is no picture").unwrap();
    image::GrayImage::from_pixel(8, 8, image::Luma([9])).save(scratch.path("in.png")).unwrap();
    let bytes = std::fs::read(scratch.path("in.png")).unwrap();
    std::fs::write(scratch.path("cut.png"), &bytes[..bytes.len() / 2]).unwrap();
    let (missing, not, cut, good) =
        (scratch.path("missing.png"), scratch.path("not.png"), scratch.path("cut.png"), scratch.path("in.png"));
    let out = scratch.path("out");
    for (arguments, word) in [
        (vec!["--image", &missing], "missing.png"),
        (vec!["--image", &not], "not.png"),
        (vec!["--image", &cut], "cut.png"),
        (vec!["--image", &good, "--sigma", "0"], "sigma"),
        (vec!["--image", &good, "--sigma", "nan"], "sigma"),
        (vec!["--image", &good, "--spray-spacing", "0"], "spray_spacing"),
        (vec!["--image", &good, "--passes", "0"], "passes"),
        (vec!["--image", &good, "--slew-limit", "0"], "slew_limit"),
        (vec!["train", "--resume", &not], "not.png"),
    ] {
        assert_refused(&[&arguments[..], &["--out", &out]].concat(), &[word]);
    }
}

/// One line that holds the words, nothing else of note, and the exit code of a failure.
fn assert_refused(arguments: &[&str], words: &[&str]) {
    let output = run(arguments);
    let text = String::from_utf8_lossy(&output.stderr).into_owned();
    assert_eq!(output.status.code(), Some(1), "{arguments:?}: {text}");
    let lines: Vec<&str> = text.lines().filter(|l| l.starts_with("paint-image: ")).collect();
    assert_eq!(lines.len(), 1, "{arguments:?}: {text}");
    assert!(words.iter().all(|word| lines[0].contains(word)), "{arguments:?}: {text}");
    assert!(!text.contains("panicked"), "{text}");
}

#[test]
fn weights_that_are_cut_or_foreign_are_named() {
    let scratch = Scratch::new("weights");
    image::GrayImage::from_pixel(8, 8, image::Luma([9])).save(scratch.path("in.png")).unwrap();
    let shipped =
        std::fs::read(concat!(env!("CARGO_MANIFEST_DIR"), "/../paint-net/weights/painter.safetensors")).unwrap();
    // A header that claims to be longer than any file, and whole weights of another network.
    let endless = [&[0xff; 8][..], &shipped[8..]].concat();
    let files = [
        ("empty", &[][..], "cut off"),
        ("header", &shipped[..100], "cut off"),
        ("half", &shipped[..shipped.len() / 2], "cut off"),
        ("last", &shipped[..shipped.len() - 1], "cut off"),
        ("endless", &endless, "cut off"),
        ("text", b"this is text, and quite a lot of it", "safetensors"),
        ("foreign", &shipped, "safetensors"),
    ];
    let (image, out) = (scratch.path("in.png"), scratch.path("out"));
    for (name, bytes, word) in files {
        let file = scratch.path(name);
        std::fs::write(&file, bytes).unwrap();
        assert_refused(&["equal-sprays", "--weights", &file, &image], &[name, word]);
        assert_refused(&["compare", "--weights", &file, &image], &[name, word]);
        assert_refused(&["train", "--resume", &file, "--out", &out], &[name, word]);
        assert_refused(&["train", "--preset", "thesis-paint", "--resume", &file, "--out", &out], &[name, word]);
    }
}

#[test]
fn absurd_settings_are_named() {
    let scratch = Scratch::new("absurd");
    image::GrayImage::from_pixel(8, 8, image::Luma([9])).save(scratch.path("in.png")).unwrap();
    let (image, out) = (scratch.path("in.png"), scratch.path("out"));
    for (setting, value, word) in [
        ("--sigma", "1e9", "`sigma`"),
        ("--cut", "-1", "`cut`"),
        ("--spray-spacing", "1000000000", "`spray_spacing`"),
        ("--row-spacing", "18446744073709551615", "`row_spacing`"),
        ("--min-volume", "1e9", "`min_volume`"),
    ] {
        let setting = format!("{setting}={value}");
        for more in [&["--painter", "feedback"][..], &["--painter", "free-sprays"], &["--palette", "cmy"]] {
            assert_refused(&[&["--image", &image, &setting, "--out", &out], more].concat(), &[word]);
        }
    }
    assert_refused(&["--image", &image, "--passes=100000000000", "--out", &out], &["`passes`"]);
    for arguments in [["--image", &image, "--threads=1000000000"], ["train", "--preset=painter", "--threads=0"]] {
        let output = run(&arguments);
        let text = String::from_utf8_lossy(&output.stderr).into_owned();
        assert!(output.status.code() == Some(2) && text.contains("give 1 to 1024 threads"), "{text}");
    }
    for setting in [
        "--layers",
        "--slew-limit=0.1",
        "--painter=closed-loop",
        "--passes=3",
        "--threads=2",
        "--scan-order=boustrophedon",
        "--weights=x",
    ] {
        let name = setting.split('=').next().unwrap();
        assert_refused(&["--image", &image, "--palette", "cmy", setting, "--out", &out], &["--palette", name]);
    }
    let folder = scratch.path("alone");
    std::fs::create_dir(&folder).unwrap();
    for (pictures, word) in [(0, "no PNG or JPEG"), (1, "give two or more")] {
        if pictures == 1 {
            std::fs::copy(&image, format!("{folder}/one.png")).unwrap();
        }
        assert_refused(&["train", "--preset", "thesis-paint", "--data", &folder, "--out", &out], &["alone", word]);
    }
    for (setting, word) in [("--steps=0", "`steps`"), ("--batch=0", "`batch`"), ("--rate=nan", "`learning_rate`")] {
        for preset in ["painter", "thesis-paint"] {
            assert_refused(&["train", "--preset", preset, setting, "--out", &out], &[word]);
        }
    }
}

#[test]
fn training_in_sittings_gives_the_same_weights() {
    let scratch = Scratch::new("train");
    let train = |name: &str, more: &[&str]| {
        let out = scratch.path(name);
        let output = run(&[&["train", "--steps", "40", "--out", &out], more].concat());
        assert!(output.status.success(), "{}", String::from_utf8_lossy(&output.stderr));
        std::fs::read(format!("{out}/painter.safetensors")).unwrap()
    };
    let at_once = train("whole", &["--until", "3"]);
    train("first", &["--until", "1"]);
    let checkpoint = scratch.path("first/checkpoint.safetensors");
    assert!(at_once == train("second", &["--until", "3", "--threads", "2", "--resume", &checkpoint]));
}
