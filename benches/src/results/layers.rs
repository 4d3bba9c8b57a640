//! Films of one to sixteen layers, predicted, beside what others measured of the same pigments (VR letter, Section VI-D; thesis, Fig. 7.8).

use std::collections::BTreeMap;
use std::error::Error;
use std::path::Path;

use clap::Parser as _;
use paintcopter::vr::{Arguments, run};

use super::extent::Extent;
use super::program_report::ProgramReport;
use super::table::{Table, number};

/// Names the folder with the measured pigments.
const DATA: &str = "PIGMENTS";

/// What the predictions are off, and the curves of each pigment; empty in a quick rerun, which needs no data, and without data.
///
/// # Errors
/// Those of `vr`, and files that it did not leave.
pub fn tables(extent: Extent, scratch: &Path) -> Result<Vec<Table>, Box<dyn Error>> {
    let (Extent::Whole, Some(data)) = (extent, std::env::var_os(DATA)) else {
        println!("layers: left out: {DATA} names the folder that `vr --experiment layers --pigments` reads");
        return Ok(Vec::new());
    };
    let folder = scratch.join("layers");
    let [data, out] = [("pigments", Path::new(&data)), ("out", &folder)].map(|(k, v)| format!("--{k}={}", v.display()));
    run(&Arguments::try_parse_from(["vr", "--experiment=layers", &data, &out])?)?;
    let report = ProgramReport::read(&folder)?;
    let figure = |name: &str| report.figure(name);

    let mut table = Table::new("layers", &["figure", "asked", "here"]);
    let (count, within) = (number(figure("pigments")?, 0), number(figure("pigments_within")?, 0));
    let asked = "mean within 1 %; greatest within 4 %: pigments";
    table.row([asked.into(), count, within]);
    for which in ["best", "median", "worst"] {
        let [mean, greatest] = [figure(&format!("{which}_error_mean"))?, figure(&format!("{which}_error_max"))?]
            .map(|error| number(100.0 * error, 1));
        table.row([format!("{which} mean; {which} greatest; %"), "-".into(), format!("{mean}; {greatest}")]);
    }
    let approaching = number(figure("pigments_approaching")?, 0);
    table.row(["each doubling of the layers comes nearer: pigments".into(), "-".into(), approaching]);
    Ok(vec![table, curves(&std::fs::read_to_string(folder.join("layers.csv"))?)?])
}

/// Errors of each pigment's films, the best first.
fn curves(csv: &str) -> Result<Table, Box<dyn Error>> {
    let mut pigments: BTreeMap<&str, BTreeMap<&str, [f64; 2]>> = BTreeMap::new();
    for line in csv.lines().skip(1) {
        if let [pigment, film, mean, greatest, ..] = line.split(',').collect::<Vec<_>>()[..] {
            let errors = [mean, greatest].map(|error| error.parse().map(|error: f64| 100.0 * error));
            let [mean, greatest] = errors;
            pigments.entry(pigment).or_default().insert(film, [mean?, greatest?]);
        }
    }
    let mut pigments: Vec<_> = pigments.into_iter().collect();
    pigments.sort_by(|(_, a), (_, b)| a["opaque"][0].total_cmp(&b["opaque"][0]));
    let head = ["pigment", "mean_1", "mean_2", "mean_4", "mean_8", "mean_16", "mean_opaque", "greatest_opaque"];
    let mut table = Table::new("fig_7_8", &head);
    for (pigment, errors) in pigments {
        let mean = |film: &str| number(errors[film][0], 1);
        let [a, b, c, d, e] = ["1", "2", "4", "8", "16"].map(mean);
        table.row([pigment.into(), a, b, c, d, e, mean("opaque"), number(errors["opaque"][1], 1)]);
    }
    Ok(table)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn pigments_come_in_the_order_of_their_errors() {
        let line = |pigment: &str, film: &str, mean: f64| format!("{pigment},{film},{mean},{},0.5\n", 2.0 * mean);
        let films = ["1", "2", "4", "8", "16", "opaque", "measured"];
        let of = |pigment: &'static str, mean: f64| films.map(|film| line(pigment, film, mean)).concat();
        let table = curves(&format!("head\n{}{}", of("far", 0.2), of("near", 0.01))).unwrap();
        assert_eq!(table.rows[0][0], "near");
        assert_eq!(table.rows[1], ["far", "20.0", "20.0", "20.0", "20.0", "20.0", "20.0", "40.0"]);
        assert!(curves("head\na,1,none,0\n").is_err());
    }
}
