//! The state of the panel: the tool and the curves that it shows, and its unfinished inputs.

use super::devices::DeviceList;
use super::history::index_of;
use super::settings::View;
use bevy::prelude::*;
use palpate_local::Scheme;
use std::path::PathBuf;

/// What the panel shows. Change it to open, close or direct it.
#[derive(Resource, Clone, Debug, Reflect)]
#[reflect(Resource, Debug, Clone)]
pub struct HapticPanel {
    /// Whether the side panel is open.
    pub open: bool,
    /// What opens and closes it.
    pub key: Option<KeyCode>,
    /// The tool that is shown; `None`, or one that is gone: the first.
    pub tool: Option<Entity>,
    /// Seconds of force and error that are shown, 1 to 15.
    pub seconds: f64,
    /// Whether the schemes that do not run are computed on the same samples while force or error is looked at.
    pub compare: bool,
    /// Schemes whose curves are drawn, by [`Scheme::ALL`].
    pub curves: [bool; 6],
    /// Where recordings go.
    pub folder: PathBuf,
    #[reflect(ignore)]
    pub(crate) view: View,
    #[reflect(ignore)]
    pub(super) present: DeviceList,
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
            present: DeviceList::default(),
        }
    }

    /// The tool that is shown, of those there are.
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

    /// Whether the curve of `scheme` is drawn.
    #[must_use]
    pub fn draws(&self, scheme: Scheme) -> bool {
        self.curves[index_of(scheme)]
    }
}
