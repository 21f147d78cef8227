//! Changes of the opened scene in memory, without reading the files again.

use std::sync::Arc;

use super::App;
use crate::import;
use crate::scene::ImportOptions;
use crate::viewer::message_with_hint;
use crate::viewer::request::Opened;

impl App {
    /// Gives the opened scene the materials and visible objects of options, which are those of changed files, too. Where
    /// other objects are visible, the camera stays, also one that frames the scene.
    pub(super) fn edit(&mut self, options: ImportOptions) {
        let camera = self.displayed_camera();
        let (Some(opened), Some(controls)) = (&self.opened, &mut self.controls) else { return };
        let mut scene = opened.scene.clone();
        if let Err(e) = import::edit(&mut scene, &options) {
            return self.show_error(message_with_hint(&e));
        }
        let before = &opened.scene.import_options;
        let Opened { camera_source, projection, size, settings, geometry, .. } = &**opened;
        let mut geometry = Arc::clone(geometry);
        let is_visible_as_before = (&before.isolate, &before.hide) == (&options.isolate, &options.hide);
        if !is_visible_as_before {
            controls.keep_camera(camera.as_ref());
        }
        if !is_visible_as_before || before.lights != options.lights {
            geometry = Arc::default();
        }
        let (camera_source, projection, size) = (camera_source.clone(), *projection, *size);
        let edited = Opened { scene, camera_source, projection, size, settings: settings.clone(), geometry };
        controls.reopened(&edited);
        self.import_options = Some(options);
        self.opened = Some(Arc::new(edited));
    }
}
