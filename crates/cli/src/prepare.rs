//! Loading of inputs into a resolved job or an animation, with timing, progress and warnings.

use std::collections::BTreeSet;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use std::time::Instant;

use super::WarningPrinter;
use super::arguments::Arguments;
use super::progress::{Mode, Progress};
use super::statistics::Seconds;
use kiln::animation::{AnimationJob, FrameRequest, play_clip};
use kiln::error::{Error, Result, Warnings};
use kiln::files::{check_output, folder_of, target_of, unfinished_in};
use kiln::import;
use kiln::job::{PictureUse, RenderSettings, ResolvedPicture, Session, warn_of_unused};
use kiln::scene::Scene;
use kiln::scene::animation::Moment;

/// Progress, times and warnings of a command.
pub(crate) struct Reporter {
    pub progress: Progress,
    pub seconds: Seconds,
    pub warnings: Warnings,
    printer: WarningPrinter,
    /// Whether warnings are printed.
    pub prints_warnings: bool,
    /// Whether notes are printed with them.
    pub prints_notes: bool,
    /// Folders of outputs so far.
    folders: BTreeSet<PathBuf>,
}

impl Reporter {
    /// Prints warnings, and notes unless there is no progress.
    pub(crate) fn new(mode: Mode) -> Self {
        Reporter { prints_warnings: true, prints_notes: mode != Mode::None, ..Reporter::silent(mode) }
    }

    /// Prints neither warnings nor notes.
    pub(crate) fn silent(mode: Mode) -> Self {
        Reporter {
            progress: Progress::new(mode),
            seconds: Seconds::default(),
            warnings: Warnings::default(),
            printer: WarningPrinter::default(),
            prints_warnings: false,
            prints_notes: false,
            folders: BTreeSet::new(),
        }
    }

    /// Begins the picture of an input, by its place among those of several.
    pub(crate) fn begin(&mut self, input: &Path, place: usize, count: usize) {
        (self.seconds, self.warnings) = (Seconds::default(), Warnings::default());
        self.printer.begin(input.display().to_string());
        self.progress.begin_part(format!("{} of {count}, {}: ", place + 1, input.display()), place, count);
    }

    /// Once all inputs are read, checks that no output is one of them. Notes unfinished files in the outputs' folders.
    ///
    /// # Errors
    /// [`Error::Usage`] for the first that is.
    pub(crate) fn check_outputs<P: AsRef<Path>>(
        &mut self,
        outputs: impl IntoIterator<Item = P>,
    ) -> Result<()> {
        for output in outputs {
            check_output(output.as_ref())?;
            let folder = folder_of(&target_of(output.as_ref())).to_owned();
            if self.folders.insert(folder.clone())
                && let [first, rest @ ..] = &unfinished_in(&folder)[..]
            {
                let more = if rest.is_empty() { String::new() } else { format!(" and {} more", rest.len()) };
                let what = "unfinished output of another process; delete it if that was killed";
                self.warnings.note(format!("{}{more}: {what}", folder.join(first).display()));
            }
        }
        Ok(())
    }

    /// Prints new warnings and notes.
    pub(crate) fn show(&mut self) {
        if self.prints_warnings {
            let notes = self.prints_notes;
            self.progress.pause(|| self.printer.print(&self.warnings, notes));
        }
    }

    /// Prints new warnings and notes, and begins a phase.
    pub(crate) fn phase(&mut self, phase: &str) {
        self.show();
        self.progress.phase(phase);
    }

    fn load(&mut self, arguments: &Arguments) -> Result<Scene> {
        self.phase("loading");
        let Reporter { seconds, warnings, .. } = self;
        timed(&mut seconds.load, || {
            import::load_with(&arguments.inputs, &arguments.options.reading(), warnings)
        })
    }

    /// Loads the inputs and resolves the render settings. `is_rounded` says whether the values of the picture are rounded to
    /// integers.
    pub(crate) fn load_and_resolve(
        &mut self,
        arguments: &Arguments,
        settings: &RenderSettings,
        is_rounded: bool,
    ) -> Result<(Session, Arc<ResolvedPicture>)> {
        let scene = self.load(arguments)?;
        note_rest_pose(&scene, &mut self.warnings);
        self.phase("preparing");
        let Reporter { seconds, warnings, .. } = self;
        timed(&mut seconds.prepare, || {
            let session = Session::still(scene)?;
            let picture = session.resolve(settings, warnings)?;
            let used = PictureUse { time: Some(Moment::of_still(session.scene()).seconds), is_rounded };
            warn_of_unused(&arguments.options, &picture.plan_settings, used, warnings);
            Ok((session, picture))
        })
    }

    /// Loads the inputs and prepares the data shared by all frames.
    pub(crate) fn load_animation(
        &mut self,
        arguments: &Arguments,
        settings: &RenderSettings,
        request: &FrameRequest,
    ) -> Result<AnimationJob> {
        let mut scene = self.load(arguments)?;
        if arguments.options.import.time.is_none() {
            play_clip(&mut scene, &arguments.options.import.clip())?;
        }
        self.phase("preparing");
        let mut warnings = std::mem::take(&mut self.warnings);
        let animation = AnimationJob::prepare(scene, settings, request, &mut warnings, |warnings| {
            self.warnings = warnings.clone();
            self.phase("building");
        });
        self.warnings = warnings;
        let animation = animation?;
        let used = PictureUse { time: None, is_rounded: request.is_displayed };
        warn_of_unused(&arguments.options, &animation.picture.plan_settings, used, &mut self.warnings);
        self.phase("rendering");
        Ok(animation)
    }

    /// With `strict`, warnings are an error. `written` says what was written all the same.
    pub(crate) fn check(&self, strict: bool, written: &str) -> Result<()> {
        if !strict || self.warnings.is_empty() {
            return Ok(());
        }
        Err(Error::Failed {
            what: format!("{} warning(s), and --strict was given", self.warnings.messages().len()),
            hint: format!("{written} written; fix what the warnings name, or leave --strict out"),
        })
    }
}

/// Notes that a scene with clips is at rest.
pub(crate) fn note_rest_pose(scene: &Scene, warnings: &mut Warnings) {
    if !scene.clips.is_empty() && scene.import_options.pose().is_none() {
        warnings.note(
            "the scene has animation clips and is rendered in the rest pose; `--time SECONDS` sets a time",
        );
    }
}

/// Calls `work` and adds its time in seconds.
pub(crate) fn timed<T>(seconds: &mut f64, work: impl FnOnce() -> T) -> T {
    let start = Instant::now();
    let result = work();
    *seconds += start.elapsed().as_secs_f64();
    result
}
