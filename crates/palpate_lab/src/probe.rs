//! `palpate-lab probe`: the force of a tool pressed into a body, from the full body and from the loop.

mod arguments;
mod hertz;
mod options;
mod plot;
mod press;
mod report;
mod scene;
mod touching;

pub(crate) use arguments::Probe;

use crate::error::LabError;
use crate::output::{Output, write_files};
use crate::progress;
use glam::DVec3;
use options::Place;
use press::{Motion, Press, PressAt};
use report::Report;
use scene::Scene;

impl Probe {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        self.validate()?;
        let places = self.places();
        let scene = Scene::of(self)?;
        let touching_m = self.touching_m(&scene, &places)?;
        let motion = Motion {
            depth_m: 1e-3 * self.depth_mm,
            speed_m_per_s: self.speed_m_per_s,
            hold_s: self.hold_s,
            integrator: self.integrator,
        };
        let bar = progress::bar(places.len());
        let mut presses = Vec::with_capacity(places.len());
        for (&(place, _), touching_m) in places.iter().zip(touching_m) {
            let press = Press::run(&scene, touching_m, &motion).map_err(|source| LabError::Press {
                x_mm: place.x_mm,
                z_mm: place.z_mm,
                source,
            })?;
            presses.push(PressAt { place, press });
            bar.inc(1);
        }
        bar.finish_and_clear();
        let report = Report::of(self, scene.top.size_m(), &presses, self.at_count());
        if let Some(folder) = output.folder() {
            let mut files = vec![
                ("probe.csv", report::ticks_csv(&presses)),
                ("probe_presses.csv", report.presses_csv()),
                ("probe.svg", plot::forces(&presses)?),
            ];
            if let Some(figure) = plot::scan(&report, self.at_count())? {
                files.push(("probe_scan.svg", figure));
            }
            write_files(folder, &files)?;
        }
        output.print(&report, |out| report.table(self, out))
    }

    /// Where the tool first touches the undeformed surface at each place, m.
    fn touching_m(&self, scene: &Scene, places: &[(Place, &'static str)]) -> Result<Vec<DVec3>, LabError> {
        let touching = |&(place, flag): &(Place, &'static str)| {
            scene.top.touching_m(self.tool, place).ok_or_else(|| {
                let [low, high] = scene.top.bounds_mm();
                LabError::NoSurface {
                    flag,
                    place: [place.x_mm, place.z_mm],
                    low: low.into(),
                    high: high.into(),
                }
            })
        };
        places.iter().map(touching).collect()
    }
}
