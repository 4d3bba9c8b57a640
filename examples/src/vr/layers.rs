//! Layers of one paint on paper (VR paper, Section VI-D): the Kubelka-Munk prediction for 1, 2, 4, 8 and 16 layers, and how near its end,
//! an opaque film, comes to what others have measured of the same pigment.

use std::collections::BTreeMap;
use std::path::Path;

use paint_sim::colour::{BANDS, Spectrum, spectrum_srgb8, wavelength};
use paint_sim::km::{opaque_reflectance, saunderson, saunderson_inverse};
use paint_sim::{Paint, Substrate};
use serde::Serialize;

use super::error::VrError;
use crate::pictures::Rgb;
use crate::report::save_figures;
use crate::whole_file;
use crate::{result, say};

/// The tables below the folder of the pigments.
const COEFFICIENTS: &str = "pigment_painter_KS/pigment_ks_380_750.csv";
const MASSTONES: &str = "okumura_golden_masstones/golden_matte_masstone_reflectance_pct.csv";
/// Names of the same pigment in the two tables.
const PAIRS: [(&str, &str); 12] = [
    ("Arylide (Hansa) yellow", "hansaYellowMedium"),
    ("Diarylide yellow", "diarylideYellow"),
    ("k pyrrole red", "pyrroleRed"),
    ("k quinacridone magenta", "quinacridoneMagenta"),
    ("dioxazine purple tints", "dioxazinePurple"),
    ("k ultramarine blue", "ultramarineBlue"),
    ("k cobalt blue", "cobaltBlue"),
    ("k cerulean blue", "ceruleanBlue"),
    ("Phthalo blue red shade", "phthaloBlue"),
    ("Phathalo blue green shade tints", "phthaloBlue"),
    ("Phathlo Green blue shade", "phthaloGreen"),
    ("Titanium White", "titaniumWhite"),
];
/// Layers of the paper's chart.
const LAYERS: [u32; 5] = [1, 2, 4, 8, 16];
/// One layer in units of the table, whose scattering is that of titanium white: the tables have no absolute thickness.
const LAYER: f64 = 0.25;
/// Reflectance of the paper.
const PAPER: f64 = 0.85;
/// Light that the surface of the binder throws back: none outside, since the gloss was not measured, and that of index 1.5 inside
/// (Saunderson 1942).
const OUTSIDE: f64 = 0.0;
const INSIDE: f64 = 0.596_35;
/// What a pigment that is predicted well stays below: mean and greatest error.
const WELL: [f64; 2] = [0.01, 0.04];
/// Patches of the picture, pixels.
const PATCH: u32 = 48;

/// `report.json`; errors are of reflectance, over all bands of one pigment.
#[derive(Debug, Serialize)]
struct LayerFigures {
    pigments: usize,
    pigments_within: usize,
    best_error_mean: f64,
    best_error_max: f64,
    median_error_mean: f64,
    median_error_max: f64,
    worst_error_mean: f64,
    worst_error_max: f64,
    /// Pigments whose chart comes nearer to the measured film with every doubling of the layers.
    pigments_approaching: usize,
    version: &'static str,
}

/// A pigment of the chart, reflectances as they would be measured.
struct Row {
    name: &'static str,
    layers: [Spectrum; LAYERS.len()],
    opaque: Spectrum,
    measured: Spectrum,
}

impl Row {
    /// Mean and greatest distance of a film from what was measured.
    fn error(&self, film: &Spectrum) -> [f64; 2] {
        let each = || film.iter().zip(&self.measured).map(|(a, b)| (a - b).abs());
        [each().sum::<f64>() / BANDS as f64, each().fold(0.0, f64::max)]
    }
}

/// Writes `layers.png`, a row for each pigment: paper, its layers, the opaque film, and what was measured; `layers.csv`; `report.json`.
pub(super) fn save_layers(pigments: &Path, folder: &Path) -> Result<(), VrError> {
    let rows = chart(pigments)?;
    let mut table = String::from("pigment,film,error_mean,error_max");
    table.extend((0..BANDS).map(|band| format!(",R{:.0}", wavelength(band))));
    table.push('\n');
    let mut line = |name: &str, film: &str, [mean, max]: [f64; 2], spectrum: &Spectrum| {
        let bands: Vec<String> = spectrum.iter().map(|r| format!("{r:.5}")).collect();
        table.extend([format!("{name},{film},{mean:.5},{max:.5},{}\n", bands.join(","))]);
    };
    for row in &rows {
        for (count, film) in LAYERS.iter().zip(&row.layers) {
            line(row.name, &count.to_string(), row.error(film), film);
        }
        line(row.name, "opaque", row.error(&row.opaque), &row.opaque);
        line(row.name, "measured", [0.0; 2], &row.measured);
    }
    let path = folder.join("layers.csv");
    whole_file::write(&path, table).map_err(VrError::unwritable(&path))?;
    picture(&rows).save(&folder.join("layers.png"))?;

    let mut errors: Vec<[f64; 2]> = rows.iter().map(|row| row.error(&row.opaque)).collect();
    for (row, [mean, max]) in rows.iter().zip(&errors) {
        result!("{:32} mean {:4.1} %, at most {:4.1} %", row.name, 100.0 * mean, 100.0 * max);
    }
    let within = errors.iter().filter(|[mean, max]| *mean <= WELL[0] && *max <= WELL[1]).count();
    let approaching = |row: &&Row| row.layers.windows(2).all(|pair| row.error(&pair[1])[0] <= row.error(&pair[0])[0]);
    errors.sort_by(|a, b| a[0].total_cmp(&b[0]));
    let mut greatest: Vec<f64> = errors.iter().map(|error| error[1]).collect();
    greatest.sort_by(f64::total_cmp);
    let last = rows.len() - 1;
    let figures = LayerFigures {
        pigments: rows.len(),
        pigments_within: within,
        best_error_mean: errors[0][0],
        best_error_max: greatest[0],
        median_error_mean: errors[rows.len() / 2][0],
        median_error_max: greatest[rows.len() / 2],
        worst_error_mean: errors[last][0],
        worst_error_max: greatest[last],
        pigments_approaching: rows.iter().filter(approaching).count(),
        version: env!("CARGO_PKG_VERSION"),
    };
    Ok(save_figures(&figures, folder)?)
}

/// The pigments that both tables have; at least one.
fn chart(folder: &Path) -> Result<Vec<Row>, VrError> {
    let (coefficients_at, masstones_at) = (folder.join(COEFFICIENTS), folder.join(MASSTONES));
    let coefficients = spectra(&coefficients_at, 2)?;
    let masstones = spectra(&masstones_at, 1)?;
    let paper = Substrate::grey(saunderson_inverse(PAPER, OUTSIDE, INSIDE)?)?;
    let mut rows = Vec::new();
    for (name, measured) in PAIRS {
        let found =
            (coefficients.get(&format!("{name},K")), coefficients.get(&format!("{name},S")), masstones.get(measured));
        let (Some(k), Some(s), Some(percent)) = found else {
            say!("{name}: not in both tables, left out");
            continue;
        };
        let paint = Paint::new(k, s, 1.0)?;
        let outside = |inner: &Spectrum| -> Result<Spectrum, paint_sim::Error> {
            let mut seen = [0.0; BANDS];
            for (seen, inner) in seen.iter_mut().zip(inner) {
                *seen = saunderson(*inner, OUTSIDE, INSIDE)?;
            }
            Ok(seen)
        };
        let mut layers = [[0.0; BANDS]; LAYERS.len()];
        for (film, count) in layers.iter_mut().zip(LAYERS) {
            *film = outside(paint.over(f64::from(count) * LAYER, &paper)?.reflectance())?;
        }
        let opaque = outside(&std::array::from_fn(|band| opaque_reflectance(k[band] / s[band])))?;
        rows.push(Row { name, layers, opaque, measured: percent.map(|r| r / 100.0) });
    }
    if rows.is_empty() {
        let why = format!("has none of the pigments that {} has", coefficients_at.display());
        return Err(VrError::Pigments { path: masstones_at, why });
    }
    Ok(rows)
}

/// The rows of a table by name (its first columns, joined by commas), in the bands of the simulator.
fn spectra(path: &Path, names: usize) -> Result<BTreeMap<String, Spectrum>, VrError> {
    let fault = |why: String| VrError::Pigments { path: path.into(), why };
    let text = std::fs::read_to_string(path).map_err(|why| fault(format!("cannot be read ({why})")))?;
    let mut lines = text.lines();
    let header: Vec<&str> = lines.next().unwrap_or("").trim().split(',').collect();
    let column = |band: usize| {
        let wanted = wavelength(band);
        let at = header.iter().skip(names).position(|cell| cell.parse() == Ok(wanted));
        at.map(|at| at + names).ok_or_else(|| fault(format!("has no column for {wanted:.0} nm")))
    };
    let columns = (0..BANDS).map(column).collect::<Result<Vec<usize>, _>>()?;
    let mut spectra = BTreeMap::new();
    for (number, line) in lines.enumerate().filter(|(_, line)| !line.trim().is_empty()) {
        let cells: Vec<&str> = line.trim().split(',').collect();
        let mut spectrum = [0.0; BANDS];
        for (value, column) in spectrum.iter_mut().zip(&columns) {
            let number_at =
                || fault(format!("line {}: needs a number that is not negative in column {}", number + 2, column + 1));
            let cell: Option<f64> = cells.get(*column).and_then(|cell| cell.parse().ok());
            *value = cell.filter(|v| v.is_finite() && *v >= 0.0).ok_or_else(number_at)?;
        }
        // Of several rows of one name the first counts.
        spectra.entry(cells[..names].join(",")).or_insert(spectrum);
    }
    Ok(spectra)
}

fn picture(rows: &[Row]) -> Rgb {
    let paper = [PAPER; BANDS];
    let patch = |spectrum: &Spectrum| spectrum_srgb8(spectrum).rgb;
    let line = |row: &Row| {
        let mut patches = vec![patch(&paper)];
        patches.extend(row.layers.iter().chain([&row.opaque, &row.measured]).map(patch));
        patches
    };
    let patches: Vec<[u8; 3]> = rows.iter().flat_map(line).collect();
    Rgb::from_pixels(LAYERS.len() + 3, rows.len(), patches).enlarged(PATCH)
}
