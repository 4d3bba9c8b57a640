//! Where a recording comes from: metadata and attachments that make it again.

use std::collections::BTreeMap;
use std::path::Path;

use mcap::records::Metadata;

/// A file within a recording.
pub struct Attachment {
    /// Its name.
    pub name: &'static str,
    /// What it is.
    pub media_type: &'static str,
    /// Its bytes.
    pub data: Vec<u8>,
}

/// Where a recording comes from.
#[derive(Default)]
pub struct Origin {
    /// By which all that is random was chosen.
    pub seed: Option<u64>,
    /// What else makes it again.
    pub attachments: Vec<Attachment>,
}

impl Origin {
    /// Of a mission whose results lie in `folder`: the robot, and `mission.toml` from there or, for one coat of several, from the folder
    /// above.
    pub(crate) fn mission(seed: u64, urdf: String, folder: &Path) -> Self {
        let robot = Attachment { name: "robot.urdf", media_type: "application/xml", data: urdf.into_bytes() };
        let mut mission = [Some(folder), folder.parent()].into_iter().flatten();
        let mission = mission.find_map(|folder| std::fs::read(folder.join("mission.toml")).ok());
        let mission = mission.map(|data| Attachment { name: "mission.toml", media_type: "application/toml", data });
        Self { seed: Some(seed), attachments: mission.into_iter().chain([robot]).collect() }
    }

    /// What the metadata record says.
    pub(crate) fn metadata(&self) -> Metadata {
        let version = ("version".to_string(), env!("CARGO_PKG_VERSION").to_string());
        let seed = self.seed.map(|seed| ("seed".to_string(), seed.to_string()));
        let again = self.attachments.iter().any(|file| file.name == "mission.toml");
        let command = again.then(|| ("command".into(), "paintcopter --mission mission.toml".into()));
        let all: BTreeMap<String, String> = std::iter::once(version).chain(seed).chain(command).collect();
        Metadata { name: "paintcopter".into(), metadata: all }
    }
}
