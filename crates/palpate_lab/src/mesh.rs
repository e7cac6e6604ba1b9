//! `palpate-lab mesh`: whether a mesh file becomes a body, what was assumed about it, and how the body feels.

mod arguments;
mod built;
mod places;
mod report;
mod taps;

pub(crate) use arguments::Mesh;

use crate::error::LabError;
use crate::mesh_input;
use crate::multirate::now;
use crate::output::Output;
use built::BuiltMesh;
use palpate_files::{MeshFile, MeshFileError};
use report::{ListedPiece, RejectedReport, Report};
use taps::Taps;

impl Mesh {
    pub(crate) fn run(&self, output: &Output) -> Result<(), LabError> {
        self.validate()?;
        if self.list {
            return self.print_list(output);
        }
        match self.examine() {
            Ok(report) => output.print(&report, |out| report.table(out)),
            Err(error) => {
                output.print(&RejectedReport::of(&error), |_| Ok(()))?;
                Err(error)
            }
        }
    }

    fn examine(&self) -> Result<Report, LabError> {
        let file = MeshFile::read(&self.file);
        let start = now();
        let part = file.and_then(|file| mesh_input::join(&file, &self.selection()));
        let mut built = BuiltMesh::of(part.map_err(|error| self.unreadable(&error))?, self, start)?;
        let taps = Taps::run(&mut built, self.taps, self.coupling())?;
        Ok(Report::of(&built, &taps, self.coupling()))
    }

    fn print_list(&self, output: &Output) -> Result<(), LabError> {
        let file = MeshFile::read(&self.file).map_err(|error| self.unreadable(&error))?;
        let listed: Vec<ListedPiece> = file.pieces.iter().map(ListedPiece::of).collect();
        output.print(&listed, |out| file.pieces.iter().try_for_each(|piece| writeln!(out, "{piece}")))
    }

    fn unreadable(&self, error: &MeshFileError) -> LabError {
        self.rejected(error.to_string())
    }
}
