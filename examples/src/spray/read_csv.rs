//! A motion from a table.

use nalgebra::{Point3, UnitVector3, Vector3};

use super::motion::NozzleSample;

/// Columns of time, nozzle and axis.
const COLUMNS: [&str; 7] = ["time_s", "nozzle_x_m", "nozzle_y_m", "nozzle_z_m", "axis_x", "axis_y", "axis_z"];
const FLOW: &str = "nozzle_flow_m3_per_s";

/// Reads a table with a line of names and numbers between commas: `time_s`, `nozzle_x_m`, `nozzle_y_m`, `nozzle_z_m`, `axis_x`, `axis_y`, `axis_z`,
/// and `nozzle_flow_m3_per_s` unless there is one flow for all. Other columns may lie between, as in `trajectory.csv`.
///
/// # Errors
/// What is wrong, with its line.
pub fn read_csv(text: &str, flow: Option<f64>) -> Result<Vec<NozzleSample>, String> {
    let mut lines = text.lines().enumerate().filter(|(_, line)| !line.trim().is_empty());
    let (_, head) = lines.next().ok_or("is empty")?;
    let names: Vec<&str> = head.trim_start_matches('\u{feff}').split(',').map(str::trim).collect();
    let column = |name: &str| names.iter().position(|found| *found == name);
    let missing = |name: &str| format!("has no column {name}: expected {} and {FLOW}", COLUMNS.join(", "));
    let mut columns = [0; COLUMNS.len()];
    for (place, name) in columns.iter_mut().zip(COLUMNS) {
        *place = column(name).ok_or_else(|| missing(name))?;
    }
    let flow_column = match flow {
        Some(_) => None,
        None => Some(column(FLOW).ok_or_else(|| format!("{}, or --flow", missing(FLOW)))?),
    };
    let sample = |(number, line): (usize, &str)| {
        let cells: Vec<&str> = line.split(',').map(str::trim).collect();
        let value = |place: usize| {
            let value = cells.get(place).and_then(|cell| cell.parse::<f64>().ok()).filter(|v| v.is_finite());
            value.ok_or_else(|| format!("line {}: column {} is no number", number + 1, names[place]))
        };
        let [time, x, y, z, dx, dy, dz] = columns.map(value);
        let axis = UnitVector3::try_new(Vector3::new(dx?, dy?, dz?), 1e-6);
        Ok(NozzleSample {
            time: time?,
            position: Point3::new(x?, y?, z?),
            axis: axis.ok_or_else(|| format!("line {}: the axis has no length", number + 1))?,
            flow: flow_column.map_or(Ok(flow.unwrap_or_default()), value)?,
        })
    };
    lines.map(sample).collect()
}
