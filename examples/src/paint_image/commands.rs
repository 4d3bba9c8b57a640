//! What is sprayed, in painting order: as JSON, and with times as MCAP.

use std::collections::BTreeMap;
use std::path::Path;

use paint_net::Spray;
use serde::Serialize;

use super::error::PaintImageError;
use super::files::write_json;
use crate::whole_file::WholeFile;

/// Speed of the nozzle in `commands.mcap`, pixels per second.
pub const NOZZLE_SPEED: f64 = 100.0;

/// One spray. `commands.json` holds it as a list of the same order.
#[derive(Debug, Clone, Copy, Serialize)]
pub(super) struct Command {
    x_px: f64,
    y_px: f64,
    volume: f64,
    sigma_px: f64,
    paint: usize,
}

/// JSON schema of a `Command`.
fn schema() -> serde_json::Value {
    let description = format!(
        "One spray. Time: the nozzle goes straight from spray to spray at {NOZZLE_SPEED} px/s; the first is at 0 s."
    );
    let number = |description: &str| serde_json::json!({"type": "number", "description": description});
    serde_json::json!({
        "title": "paintcopter.Spray", "description": description, "type": "object",
        "properties": {
            "x_px": number("column of the centre"),
            "y_px": number("row of the centre, 0 at the top"),
            "volume": number("depth of paint at the centre, as in the spray model of commands.json"),
            "sigma_px": number("standard deviation of the footprint"),
            "paint": {"type": "integer", "description": "place in the list of paints of commands.json, from 0"},
        },
        "required": ["x_px", "y_px", "volume", "sigma_px", "paint"],
    })
}

/// The sprays of one paint.
pub(super) fn commands(sprays: &[Spray], paint: usize) -> impl Iterator<Item = Command> {
    sprays.iter().map(move |s| Command { x_px: s.x, y_px: s.y, volume: s.volume, sigma_px: s.sigma, paint })
}

/// Writes `commands.json` and `commands.mcap`.
pub(super) fn save(
    folder: &Path,
    (width, height): (usize, usize),
    spray_model: &serde_json::Value,
    paints: &[&str],
    commands: &[Command],
) -> Result<(), PaintImageError> {
    let sprays: Vec<_> = commands.iter().map(|c| (c.x_px, c.y_px, c.volume, c.sigma_px, c.paint)).collect();
    let all = serde_json::json!({
        "width": width, "height": height, "spray_model": spray_model, "paints": paints, "sprays": sprays,
    });
    write_json(&folder.join("commands.json"), &all)?;
    let path = folder.join("commands.mcap");
    record(&path, commands).map_err(|e| PaintImageError::File {
        path: path.display().to_string(),
        why: format!("cannot be written ({e})"),
    })
}

fn record(path: &Path, commands: &[Command]) -> mcap::McapResult<()> {
    let file = WholeFile::create(path)?;
    let mut writer = mcap::WriteOptions::new().compression(None).library("paintcopter").create(file)?;
    let schema = writer.add_schema("paintcopter.Spray", "jsonschema", schema().to_string().as_bytes())?;
    let channel_id = writer.add_channel(schema, "/sprays", "json", &BTreeMap::new())?;
    let (mut time, mut last) = (0.0, None);
    for (sequence, command) in (0..).zip(commands) {
        let place = (command.x_px, command.y_px);
        let (x, y) = last.replace(place).unwrap_or(place);
        time += (place.0 - x).hypot(place.1 - y) / NOZZLE_SPEED;
        let log_time = (1e9 * time).round() as u64;
        let header = mcap::records::MessageHeader { channel_id, sequence, log_time, publish_time: log_time };
        let message = serde_json::to_vec(command).map_err(std::io::Error::from)?;
        writer.write_to_known_channel(&header, &message)?;
    }
    writer.finish()?;
    Ok(writer.into_inner().commit()?)
}
