//! Draws every scene, with Mesa's software driver if there is no other, and checks the pictures for their content.
//!
//! `cargo test -p palpate_examples --features panel,gizmos,avian --test pictures` writes the pictures to `target/palpate/pictures`. Those of the
//! README are in `assets/pictures`: copy the last one of a scene there to update them.

use image::{Rgb, RgbImage};
use std::path::{Path, PathBuf};
use std::process::Command;

/// A scene and the content of its last picture.
struct Scene {
    name: &'static str,
    /// Further arguments.
    args: &'static [&'static str],
    /// Times of the pictures, s.
    at_s: &'static str,
    /// Value of `--gizmos`.
    gizmos: &'static str,
    /// Content: name, test of a pixel, and minimum number of such pixels.
    has: &'static [(&'static str, fn(Rgb<u8>) -> bool, usize)],
}

/// Whether a pixel has the colour of bodies, lit or in shadow.
fn is_flesh([r, g, b]: [u8; 3]) -> bool {
    let [r, g, b] = [r, g, b].map(f32::from);
    r > 60.0 && r > 1.35 * g && r > 1.25 * b
}

fn body(Rgb(c): Rgb<u8>) -> bool {
    is_flesh(c)
}

fn first_tool(Rgb([r, g, b]): Rgb<u8>) -> bool {
    let [r, g, b] = [r, g, b].map(f32::from);
    b > 90.0 && b > 1.5 * r && b > 1.15 * g
}

fn second_tool(Rgb([r, g, b]): Rgb<u8>) -> bool {
    let [r, g, b] = [r, g, b].map(f32::from);
    r > 140.0 && g > 0.5 * r && g < 0.85 * r && b < 0.5 * r
}

fn title(Rgb(c): Rgb<u8>) -> bool {
    c.iter().all(|&v| v > 235)
}

fn yellow_curve(Rgb([r, g, b]): Rgb<u8>) -> bool {
    r > 200 && g > 190 && b < 120
}

fn thread(Rgb([r, g, b]): Rgb<u8>) -> bool {
    r > 150 && g > 145 && b > 120 && r >= b && r.abs_diff(g) < 14 && r - b < 60 && !title(Rgb([r, g, b]))
}

static SCENES: [Scene; 7] = [
    Scene {
        name: "probing",
        args: &[],
        at_s: "0.5,2.85",
        gizmos: "1",
        has: &[("body", body, 8_000), ("tool", first_tool, 150), ("title", title, 150)],
    },
    Scene {
        name: "indentation",
        args: &[],
        at_s: "0.6,2.45",
        gizmos: "0",
        has: &[
            ("body", body, 8_000),
            ("tool", first_tool, 800),
            ("title", title, 150),
            ("curve", yellow_curve, 80),
        ],
    },
    Scene {
        name: "suture_pull",
        args: &[],
        at_s: "0.5,3.0",
        gizmos: "0",
        has: &[
            ("body", body, 8_000),
            ("tool", first_tool, 100),
            ("thread", thread, 60),
            ("title", title, 150),
            ("curve", yellow_curve, 60),
        ],
    },
    Scene {
        name: "two_tools",
        args: &[],
        at_s: "0.5,1.7",
        gizmos: "1",
        has: &[
            ("body", body, 8_000),
            ("first tool", first_tool, 150),
            ("second tool", second_tool, 150),
            ("title", title, 150),
        ],
    },
    Scene {
        name: "tray",
        args: &[],
        at_s: "0.5,2.4",
        gizmos: "1",
        has: &[
            ("body", body, 8_000),
            ("tool", first_tool, 100),
            ("lump", second_tool, 150),
            ("title", title, 150),
        ],
    },
    Scene {
        name: "custom_device",
        args: &[],
        at_s: "0.5,0.75",
        gizmos: "3",
        has: &[("body", body, 8_000), ("tool", first_tool, 100), ("title", title, 150)],
    },
    Scene {
        name: "your_mesh",
        args: &[concat!(env!("CARGO_MANIFEST_DIR"), "/../assets/meshes/organ.glb")],
        at_s: "0.5,0.75",
        gizmos: "1",
        has: &[("body", body, 8_000), ("tool", first_tool, 100), ("title", title, 150)],
    },
];

/// Those of this test, to build nothing twice.
const FEATURES: &str = if cfg!(feature = "avian") { "panel,gizmos,avian" } else { "panel,gizmos" };

/// The scenes that [`FEATURES`] build.
fn scenes() -> impl Iterator<Item = &'static Scene> {
    SCENES.iter().filter(|scene| cfg!(feature = "avian") || scene.name != "tray")
}

/// Draws `scene`; `None` without a graphics driver.
fn draw(scene: &Scene, folder: &Path) -> Option<Vec<RgbImage>> {
    let cargo = std::env::var("CARGO").unwrap_or_else(|_| "cargo".into());
    let mut run = Command::new(cargo);
    run.args(["run", "--quiet", "--locked", "-p", "palpate_examples", "--features", FEATURES]);
    if !cfg!(debug_assertions) {
        run.arg("--release");
    }
    run.args(["--example", scene.name, "--", "--gizmos", scene.gizmos, "--at", scene.at_s, "--pictures"])
        .arg(folder)
        .args(scene.args);
    let output = run.output().unwrap();
    let errors = String::from_utf8_lossy(&output.stderr);
    if errors.contains("draws nothing") {
        return None;
    }
    assert!(output.status.success(), "{}: {errors}", scene.name);
    let pictures = scene.at_s.split(',').enumerate().map(|(index, _)| {
        let file = folder.join(format!("{}-{}.png", scene.name, index + 1));
        let picture = image::open(&file).unwrap_or_else(|error| panic!("{}: {error}", file.display()));
        picture.to_rgb8()
    });
    Some(pictures.collect())
}

/// Errors in the `pictures` of `scene`.
fn errors(scene: &Scene, pictures: &[RgbImage]) -> Vec<String> {
    let mut errors = Vec::new();
    let Some(last) = pictures.last() else { return vec![format!("{}: no pictures", scene.name)] };
    for (what, is_it, min) in scene.has {
        let found = last.pixels().filter(|&&pixel| is_it(pixel)).count();
        if found < *min {
            errors.push(format!("{}: {found} pixels of {what}, not {min}", scene.name));
        }
    }
    for pair in pictures.windows(2) {
        let differs = |(a, b): (&Rgb<u8>, &Rgb<u8>)| {
            let apart: u32 = a.0.iter().zip(b.0).map(|(&a, b)| u32::from(a.abs_diff(b))).sum();
            // Pixels of the body, not of a tool in front of it.
            body(*a) && body(*b) && apart > 24
        };
        let moved = pair[0].pixels().zip(pair[1].pixels()).filter(|pair| differs(*pair)).count();
        if moved < 150 {
            errors.push(format!("{}: the body moved in {moved} pixels only", scene.name));
        }
    }
    errors
}

fn folder() -> PathBuf {
    let target = std::env::var_os("CARGO_TARGET_DIR")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../target"), PathBuf::from);
    let folder = target.join("palpate/pictures");
    std::fs::create_dir_all(&folder).unwrap();
    folder
}

#[test]
fn pictures_of_every_scene_have_their_content() {
    let folder = folder();
    let mut all = Vec::new();
    for scene in scenes() {
        let Some(pictures) = draw(scene, &folder) else {
            #[expect(clippy::print_stderr, reason = "the reason of a skipped test")]
            {
                eprintln!("skipped: there is no graphics driver (Vulkan on Linux)");
            }
            return;
        };
        all.extend(errors(scene, &pictures));
    }
    assert!(all.is_empty(), "{all:#?}\nsee {}", folder.display());
}

#[test]
fn blank_and_unchanged_pictures_are_errors() {
    let blank = RgbImage::from_pixel(640, 360, Rgb([20, 24, 30]));
    for scene in scenes() {
        let found = errors(scene, &[blank.clone(), blank.clone()]);
        assert_eq!(found.len(), scene.has.len() + 1, "{found:?}");
    }
}
