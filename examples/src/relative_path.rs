//! Paths from a folder to a file.

use std::path::{Component, Path, PathBuf};

/// The way from a folder to a file that is named from here; the file from the root where both have no folder in common, or where the system
/// does not tell where they are.
pub(crate) fn from_folder(folder: &Path, file: PathBuf) -> PathBuf {
    let here = if folder.as_os_str().is_empty() { Path::new(".") } else { folder };
    let Ok(to) = file.canonicalize() else { return std::path::absolute(&file).unwrap_or(file) };
    let Ok(from) = here.canonicalize() else { return to };
    let common = from.components().zip(to.components()).take_while(|(a, b)| a == b).count();
    if !from.components().take(common).any(|part| matches!(part, Component::Normal(_))) {
        return to;
    }
    let up = from.components().skip(common).map(|_| Component::ParentDir);
    up.chain(to.components().skip(common)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_way_leads_there_and_can_be_moved() {
        let root = std::env::temp_dir().join(format!("paintcopter-relative-{}", std::process::id()));
        std::fs::create_dir_all(root.join("job/out/wall")).unwrap();
        let mesh = root.join("job/mesh.obj");
        std::fs::write(&mesh, "o").unwrap();
        let folder = root.join("job/out/wall");
        assert_eq!(from_folder(&folder, mesh.clone()), Path::new("../../mesh.obj"));
        assert_eq!(from_folder(&root.join("job"), mesh.clone()), Path::new("mesh.obj"));
        std::fs::rename(root.join("job"), root.join("moved")).unwrap();
        assert_eq!(std::fs::read(root.join("moved/out/wall").join("../../mesh.obj")).unwrap(), b"o");
        // What is not there, and what has nothing in common, is said from the root.
        assert_eq!(from_folder(&folder, mesh.clone()), mesh);
        #[cfg(unix)]
        assert_eq!(from_folder(&root, "/etc/passwd".into()), Path::new("/etc/passwd"));
        std::fs::remove_dir_all(&root).unwrap();
    }
}
