//! The mesh that is measured, from files or generated, and where it is seen from.

use std::path::PathBuf;

use clap::Args;

use super::super::WarningPrinter;
use super::super::arguments::inputs_help;
use crate::options::{Table, parser};
use kiln::error::{Error, Result, Warnings, nearest_name};
use kiln::import;
use kiln::scene::option::group;
use kiln::scene::{ImportOptions, Scene};
use kiln::world::recenter;
use kiln_lab::bench::Mesh;
use kiln_lab::bench::generate::Family;
use kiln_lab::bench::speed::{ViewSetup, Viewpoint, scene, triangles, view_setup};

#[derive(Args)]
pub(crate) struct Subject {
    /// Input files; a generated mesh without.
    #[arg(value_name = "INPUT", help = inputs_help("Input files, combined into one scene") + " [default: a generated mesh]")]
    inputs: Vec<PathBuf>,
    /// Width and height in pixels of the picture that rays are generated for
    #[arg(long, help_heading = group::MEASUREMENT, allow_hyphen_values = true, value_name = "N", default_value_t = 1024, value_parser = crate::numbers::whole(16..=8192u32))]
    pub size: u32,
    /// Origin of the camera rays: the scene's camera (without one, outside), outside the mesh, or inside it
    #[arg(long, help_heading = group::MEASUREMENT, value_name = "PLACE", default_value = "scene", value_parser = parser::<Viewpoint>())]
    from: Viewpoint,
    /// Approximate number of triangles of the generated mesh, a bumpy sphere
    #[arg(long, help_heading = group::MEASUREMENT, value_name = "N", default_value_t = 1_000_000, conflicts_with = "inputs",
          value_parser = crate::numbers::whole(100..=20_000_000u32))]
    triangles: u32,
    #[command(flatten)]
    pub import: Table<ImportOptions>,
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

    /// Refuses an input that is no file but almost the name of a benchmark.
    pub(super) fn refuse_misspelled(&self, benchmarks: &clap::Command) -> Result<()> {
        let [input, ..] = self.inputs.as_slice() else { return Ok(()) };
        let names: Vec<&str> = benchmarks.get_subcommands().map(clap::Command::get_name).collect();
        let hint = nearest_name(&input.to_string_lossy(), &names);
        if input.exists() || !hint.starts_with("did you mean") {
            return Ok(());
        }
        Err(Error::usage(format!("{}: neither a file nor a benchmark", input.display()), hint))
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
        if let count @ 1.. = triangles.analytic_shapes {
            warnings.note(format!("{count} analytic shape(s) left out: triangles alone are compared"));
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
