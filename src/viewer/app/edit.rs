//! Changes of the opened scene in memory, without reading the files again.

use std::sync::Arc;

use super::App;
use crate::error::Result;
use crate::scene::{ImportOptions, Scene};
use crate::viewer::message_with_hint;
use crate::viewer::request::Opened;

impl App {
    /// Shows other objects. The camera stays, also one that frames the scene.
    pub(super) fn show_objects(&mut self, options: ImportOptions) {
        self.edit(&options, |scene| scene.set_visible(&options.isolate, &options.hide));
    }

    /// Changes the opened scene by `how`; it then is that of `options`, with which changed files are read.
    fn edit(&mut self, options: &ImportOptions, how: impl FnOnce(&mut Scene) -> Result<()>) {
        let camera = self.displayed_camera();
        let (Some(opened), Some(controls)) = (&self.opened, &mut self.controls) else { return };
        let mut scene = opened.scene.clone();
        if let Err(e) = how(&mut scene) {
            return self.show_error(message_with_hint(&e));
        }
        scene.import_options = options.clone();
        let Opened { camera_source, projection, size, settings, .. } = &**opened;
        let (camera_source, projection) = (camera_source.clone(), *projection);
        let edited = Opened { scene, camera_source, projection, size: *size, settings: settings.clone() };
        controls.keep_camera(camera.as_ref());
        controls.reopened(&edited);
        self.import_options = Some(options.clone());
        self.opened = Some(Arc::new(edited));
    }
}
