//! The state of the panel: the tool and the curves that it shows, and its unfinished inputs.

use super::devices::DeviceList;
use super::history::index_of;
use super::settings::View;
use super::stress::StressSection;
use bevy::prelude::*;
use palpate_local::Scheme;
use std::path::PathBuf;

/// State of the panel: visibility, the shown tool and curves.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(Resource, Debug, Clone)]
pub struct HapticPanel {
    /// Whether the side panel is open.
    pub open: bool,
    /// Key that opens and closes the side panel.
    pub key: Option<KeyCode>,
    /// The shown tool; the first one if `None` or if the entity is no tool.
    pub tool: Option<Entity>,
    /// Duration of the shown force and error, s, 1 to 15.
    pub seconds: f64,
    /// Whether the inactive schemes are computed on the same samples while force or error is visible.
    pub compare: bool,
    /// Whether each scheme's curve is drawn, in the order of [`Scheme::ALL`].
    pub curves: [bool; 6],
    /// Folder of recordings.
    pub folder: PathBuf,
    #[reflect(ignore)]
    pub(crate) view: View,
    #[reflect(ignore)]
    pub(super) devices: DeviceList,
    #[reflect(ignore)]
    pub(super) stress: StressSection,
}

impl HapticPanel {
    pub(super) fn new(open: bool, key: Option<KeyCode>, folder: PathBuf) -> Self {
        let (seconds, curves) = (5.0, [true; 6]);
        Self {
            open,
            key,
            tool: None,
            seconds,
            compare: true,
            curves,
            folder,
            view: View::default(),
            devices: DeviceList::default(),
            stress: StressSection::default(),
        }
    }

    /// The shown one of `tools`.
    pub(super) fn shown(&self, tools: impl Iterator<Item = Entity>) -> Option<Entity> {
        let mut first: Option<Entity> = None;
        for tool in tools {
            if self.tool == Some(tool) {
                return Some(tool);
            }
            first = Some(first.map_or(tool, |first| first.min(tool)));
        }
        first
    }

    /// Returns whether the curve of `scheme` is drawn.
    #[must_use]
    pub fn draws(&self, scheme: Scheme) -> bool {
        self.curves[index_of(scheme)]
    }
}
