//! Wavefront MTL: `Kd` and `map_Kd` of every material. What lights and shines is passed over.

use std::collections::HashMap;
use std::path::{Path, PathBuf};

use uv_param::texture::linear_from_srgb;

use super::material::{MeshMaterial, TextureSource};

/// Materials by name; what had to be left aside is told in `notes`.
pub(super) fn read(path: &Path, notes: &mut Vec<String>) -> HashMap<String, MeshMaterial> {
    let mut materials: HashMap<String, MeshMaterial> = HashMap::new();
    let text = match std::fs::read(path) {
        Ok(bytes) => String::from_utf8_lossy(&bytes).into_owned(),
        Err(error) => {
            notes.push(format!("{}: not read ({error}), its materials are white", path.display()));
            return materials;
        }
    };
    let folder = path.parent().unwrap_or(Path::new(""));
    let mut name = None;
    for line in text.lines() {
        let line = line.trim();
        let (key, rest) = line.split_once(char::is_whitespace).unwrap_or((line, ""));
        let rest = rest.trim();
        if key == "newmtl" {
            name = Some(rest.to_owned());
            materials.insert(rest.to_owned(), MeshMaterial::default());
        }
        let Some(material) = name.as_ref().and_then(|name| materials.get_mut(name)) else { continue };
        match key {
            "Kd" => {
                let values: Vec<f32> = rest.split_whitespace().filter_map(|w| w.parse().ok()).collect();
                if let [r, g, b] = values[..] {
                    material.colour = [r, g, b].map(|c| linear_from_srgb(c.clamp(0.0, 1.0)));
                }
            }
            "map_Kd" => match existing(folder, file_name(rest, notes)) {
                Ok(file) => {
                    material.texture = Some(TextureSource::File(file));
                }
                Err(file) => notes.push(format!("{}: texture {file} is not there and is left aside", path.display())),
            },
            _ => {}
        }
    }
    // The picture is the colour; exporters write black or grey beside it.
    for material in materials.values_mut().filter(|material| material.texture.is_some()) {
        material.colour = [1.0; 3];
    }
    materials
}

/// The file after the options of a map, which may have spaces in its name.
fn file_name<'a>(mut rest: &'a str, notes: &mut Vec<String>) -> &'a str {
    while let Some(option) = rest.strip_prefix('-') {
        let (option, mut after) = option.split_once(char::is_whitespace).unwrap_or((option, ""));
        let arguments = match option {
            "s" | "o" | "t" => 3,
            "mm" => 2,
            _ => 1,
        };
        if matches!(option, "s" | "o") {
            notes.push(format!(
                "option -{option} of map_Kd {rest} is left aside: the texture is neither scaled nor moved"
            ));
        }
        for k in 0..arguments {
            let (word, next) = after.trim_start().split_once(char::is_whitespace).unwrap_or((after, ""));
            // Vectors may be shorter than three.
            if k > 0 && word.parse::<f64>().is_err() {
                break;
            }
            after = next;
        }
        rest = after.trim_start();
    }
    rest.trim_matches('"')
}

/// The file as named, beside the MTL, or with its last name only: exporters write the paths of their own machine.
fn existing(folder: &Path, named: &str) -> Result<PathBuf, String> {
    let slashed = named.replace('\\', "/");
    let last = slashed.rsplit('/').next().unwrap_or("");
    let candidates = [folder.join(&slashed), folder.join(last)];
    candidates.into_iter().find(|file| !last.is_empty() && file.is_file()).ok_or_else(|| format!("\"{named}\""))
}

#[cfg(test)]
mod tests {
    use super::file_name;

    #[test]
    fn a_file_comes_after_the_options_and_their_arguments() {
        for (line, file, noted) in [
            ("brick wall.png", "brick wall.png", 0),
            ("-blendu on brick wall.png", "brick wall.png", 0),
            ("-mm 0.1 0.9 brick.png", "brick.png", 0),
            ("-s 2 2 brick.png", "brick.png", 1),
            ("-s 2 2 2 -o 1 \"brick.png\"", "brick.png", 2),
        ] {
            let mut notes = Vec::new();
            assert_eq!((file_name(line, &mut notes), notes.len()), (file, noted), "{line}");
        }
    }
}
