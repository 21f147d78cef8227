//! The mesh that is measured, from files or generated, and where it is seen from.

use std::path::PathBuf;

use clap::Args;

use super::super::WarningPrinter;
use super::super::arguments::inputs_help;
use crate::bench::Mesh;
use crate::bench::generate::Family;
use crate::bench::speed::{ViewSetup, Viewpoint, scene, triangles, view_setup};
use crate::error::{Error, Result, Warnings};
use crate::import;
use crate::scene::option::parser;
use crate::scene::{ImportOptions, Scene};
use crate::world::recenter;

#[derive(Args)]
pub(crate) struct Subject {
    /// Files to put into one scene; a bumpy sphere, if not given.
    #[arg(value_name = "INPUT", help = format!("{}; a bumpy sphere, if not given", inputs_help("Files to put into one scene")))]
    inputs: Vec<PathBuf>,
    #[command(flatten)]
    pub import: ImportOptions,
    /// Width and height in pixels of the picture that rays are cast for
    #[arg(long, allow_hyphen_values = true, value_name = "N", default_value_t = 1024, value_parser = crate::cli::numbers::whole(16..=8192u32))]
    pub size: u32,
    /// Where it is seen from: by the scene's camera or else from outside, from outside, or from its middle
    #[arg(long, value_name = "PLACE", default_value = "scene", value_parser = parser::<Viewpoint>())]
    from: Viewpoint,
    /// Triangles of the bumpy sphere, about
    #[arg(long, value_name = "N", default_value_t = 1_000_000, conflicts_with = "inputs",
          value_parser = crate::cli::numbers::whole(100..=20_000_000u32))]
    triangles: u32,
}

impl Subject {
    /// Name of the mesh and viewpoint.
    pub(crate) fn name(&self) -> String {
        let name =
            |file: &PathBuf| file.file_name().unwrap_or(file.as_os_str()).to_string_lossy().into_owned();
        let files: Vec<String> = self.inputs.iter().map(name).collect();
        let place = match self.from {
            Viewpoint::Scene => String::new(),
            from => format!(", from {}", from.name()),
        };
        if files.is_empty() {
            format!("a bumpy sphere{place}")
        } else {
            format!("{}{place}", files.join(" "))
        }
    }

    /// The scene, its triangles, and the viewpoint.
    pub(crate) fn load(&self) -> Result<(Scene, Mesh, ViewSetup)> {
        let from = self.from;
        if self.inputs.is_empty() {
            let mesh = Family::Sphere.mesh(self.triangles as usize);
            let scene = scene(&mesh);
            let setup = view_setup(&scene, from, self.size)?;
            return Ok((scene, mesh, setup));
        }
        let mut warnings = Warnings::default();
        let mut scene = import::load_with(&self.inputs, &self.import, &mut warnings)?;
        recenter(&mut scene);
        let triangles = triangles(&scene);
        if triangles.spheres > 0 {
            warnings.note(format!("{} sphere(s) left out: triangles alone are compared", triangles.spheres));
        }
        WarningPrinter::default().print(&warnings, true);
        if triangles.mesh.triangles.is_empty() {
            let hint = "`kiln info` says what the files hold; without INPUT a mesh is made";
            let what = "there is no triangle in it to cast rays at";
            return Err(Error::input(self.inputs[0].as_path(), what, hint));
        }
        let setup = view_setup(&scene, from, self.size)?;
        Ok((scene, triangles.mesh, setup))
    }
}
