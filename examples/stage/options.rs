//! The command-line options of all scenes.

use bevy::prelude::Resource;
use bevy_palpate::HidSelector;
use bevy_palpate::prelude::Scheme;
use clap::Args;
use std::path::PathBuf;

/// Options of every scene.
#[derive(Args, Clone, Debug, Resource)]
pub struct StageOptions {
    /// Duration, s [default: that of the scene; with a window: until it is closed]
    #[arg(long, value_parser = seconds)]
    pub seconds: Option<f64>,
    /// Scheme by which the loop renders force between two model steps: hold, low_pass, tangent, neighbourhood, krylov_linear or
    /// near_field_exact
    #[arg(long, default_value_t)]
    pub scheme: Scheme,
    /// HID device of the first tool: first, cap, joystick, board, or a serial number
    #[arg(long, value_name = "DEVICE", num_args = 0..=1, default_missing_value = "first", value_parser = crate::device::selector)]
    #[arg(conflicts_with = "pictures")]
    pub hid: Option<HidSelector>,
    /// Run without a window
    #[arg(long)]
    pub headless: bool,
    /// Open the panel at the start
    #[arg(long)]
    pub panel: bool,
    /// Gizmos at the start: 0 none, 1 contact, tool and force, 2 near field, 3 strained lattice, 4 basis
    #[arg(long, default_value_t = 1, value_parser = view)]
    pub gizmos: usize,
    /// Draw pictures into this folder instead of opening a window, at the times of --at, in lock step
    #[arg(long, value_name = "DIR", requires = "at", conflicts_with = "headless", value_parser = folder)]
    pub pictures: Option<PathBuf>,
    /// Times of the pictures, s
    #[arg(long, value_name = "S,S,…", value_delimiter = ',', requires = "pictures", value_parser = seconds)]
    pub at: Vec<f64>,
    /// Width and height of the pictures, pixels
    #[arg(long, value_name = "W,H", default_value = "640,360", value_parser = size)]
    pub size: [u32; 2],
}

fn seconds(text: &str) -> Result<f64, String> {
    match text.parse() {
        Ok(seconds) if (0.5..=3600.0).contains(&seconds) => Ok(seconds),
        _ => Err("it must be a number from 0.5 to 3600".into()),
    }
}

fn view(text: &str) -> Result<usize, String> {
    match text.parse() {
        Ok(view) if view <= 4 => Ok(view),
        _ => Err("it must be 0 to 4".into()),
    }
}

fn size(text: &str) -> Result<[u32; 2], String> {
    let sides: Vec<u32> = text.split(',').filter_map(|side| side.parse().ok()).collect();
    match sides[..] {
        [width, height] if (64..=4096).contains(&width) && (64..=4096).contains(&height) => {
            Ok([width, height])
        }
        _ => Err("it must be two numbers from 64 to 4096, as 640,360".into()),
    }
}

/// Creates the folder, which reports errors before the scene starts.
///
/// # Errors
/// The error of the operating system.
pub fn folder(path: &str) -> Result<PathBuf, String> {
    std::fs::create_dir_all(path).map(|()| path.into()).map_err(|error| error.to_string())
}
