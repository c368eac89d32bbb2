//! The table `seven_scenes`.

use std::{
    fs,
    path::{Path, PathBuf},
};

use serde::{Deserialize, Serialize};
use vpr_core::Error;

use crate::refusal::Refusal;

/// A room of a few square metres and a hand-held camera in it.
#[derive(Clone, Debug, PartialEq, Serialize, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct SevenScenes {
    /// Which of the seven; the files are called after it.
    pub scene: String,
    /// Folder of `<scene>_train.txt` and `<scene>_test.txt`, lines of
    /// `name qw qx qy qz tx ty tz f`, world-to-camera; without it the paths are generated.
    #[serde(default, skip_serializing_if = "Option::is_none")]
    pub poses: Option<PathBuf>,
}

const SCENES: [&str; 7] = ["chess", "fire", "heads", "office", "pumpkin", "redkitchen", "stairs"];

impl SevenScenes {
    pub(crate) fn check(&self) -> Result<(), Refusal> {
        if SCENES.contains(&self.scene.as_str()) {
            return Ok(());
        }
        let reason = format!("`{}` is none of {}", self.scene, SCENES.join(", "));
        Err(Refusal { key: "seven_scenes.scene", reason })
    }

    /// Bytes of the files that the recipe refers to: they belong to its digest.
    pub(crate) fn files(&self) -> vpr_core::Result<Vec<u8>> {
        let mut bytes = Vec::new();
        for path in self.poses.iter().flat_map(|folder| self.paths(folder)) {
            bytes.extend(fs::read(&path).map_err(Error::io(&path))?);
        }
        Ok(bytes)
    }

    /// The pose files of training and test.
    pub(crate) fn paths(&self, folder: &Path) -> [PathBuf; 2] {
        ["train", "test"].map(|split| folder.join(format!("{}_{split}.txt", self.scene)))
    }
}
