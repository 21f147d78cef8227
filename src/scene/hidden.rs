//! Objects that are hidden by name: they are not in the picture, as if the files did not have them. Tracks still move
//! them, because the parts of a mesh turn about the centre of the whole.

use std::borrow::Cow;
use std::sync::Arc;

use super::{Object, Scene};
use crate::error::{Error, Result, nearest_name};

/// A hidden object.
#[derive(Debug, Clone)]
pub struct HiddenObject {
    /// Its index in [`Scene::objects`] when all are shown.
    pub index: usize,
    /// The object.
    pub object: Object,
}

impl Scene {
    /// The indices of the objects of a name and of its parts (`NAME/...`). `option` names the option in errors.
    ///
    /// # Errors
    /// [`Error::Usage`] if no object has that name.
    pub(crate) fn objects_named(&self, name: &str, option: &str) -> Result<Vec<usize>> {
        let has_name = |(index, object): (usize, &Object)| object.is_named(name).then_some(index);
        let indices: Vec<usize> = self.objects.iter().enumerate().filter_map(has_name).collect();
        if indices.is_empty() {
            let known: Vec<&str> = self.objects.iter().map(|object| object.name.as_str()).collect();
            let hint = nearest_name(name, &known);
            return Err(Error::usage(format!("{option}: no object is named `{name}`"), hint));
        }
        Ok(indices)
    }

    /// Hides the objects that the names of `isolate` leave out, if there are any, and those of the names of `hide`; shows
    /// all others.
    ///
    /// # Errors
    /// [`Error::Usage`] for a name that no object has, and if no object is left. The scene then shows all objects.
    pub fn set_visible(&mut self, isolate: &[String], hide: &[String]) -> Result<()> {
        self.show_all();
        let mut is_visible = vec![isolate.is_empty(); self.objects.len()];
        for name in isolate {
            self.objects_named(name, "--isolate")?.into_iter().for_each(|index| is_visible[index] = true);
        }
        for name in hide {
            self.objects_named(name, "--hide")?.into_iter().for_each(|index| is_visible[index] = false);
        }
        if !is_visible.is_empty() && !is_visible.contains(&true) {
            return Err(Error::usage("--hide leaves no object in the picture", "hide fewer objects"));
        }
        let hidden: Vec<usize> = (0..is_visible.len()).filter(|&index| !is_visible[index]).collect();
        self.hide_objects(&hidden);
        Ok(())
    }

    /// Shows all objects, and returns the indices of those that were hidden, in ascending order.
    pub(crate) fn show_all(&mut self) -> Vec<usize> {
        let hidden = Arc::unwrap_or_clone(std::mem::take(&mut self.hidden));
        let indices = hidden.iter().map(|hidden| hidden.index).collect();
        // In ascending order, so that each index is that of the object in the list so far.
        hidden.into_iter().for_each(|HiddenObject { index, object }| self.objects.insert(index, object));
        indices
    }

    /// The scene with all objects shown.
    pub(crate) fn with_hidden(&self) -> Cow<'_, Scene> {
        if self.hidden.is_empty() {
            return Cow::Borrowed(self);
        }
        let mut all = self.clone();
        all.show_all();
        Cow::Owned(all)
    }

    /// Hides the objects of these indices, in ascending order, of a scene that shows all.
    pub(crate) fn hide_objects(&mut self, indices: &[usize]) {
        let mut hidden = Vec::with_capacity(indices.len());
        for (index, object) in std::mem::take(&mut self.objects).into_iter().enumerate() {
            match indices.binary_search(&index) {
                Ok(_) => hidden.push(HiddenObject { index, object }),
                Err(_) => self.objects.push(object),
            }
        }
        self.hidden = Arc::new(hidden);
    }

    /// All objects in their order, and whether each is visible.
    pub fn all_objects(&self) -> impl Iterator<Item = (&Object, bool)> {
        let (mut visible, mut hidden) = (self.objects.iter(), self.hidden.iter().peekable());
        (0..self.objects.len() + self.hidden.len()).filter_map(move |index| {
            match hidden.next_if(|hidden| hidden.index == index) {
                Some(hidden) => Some((&hidden.object, false)),
                None => visible.next().map(|object| (object, true)),
            }
        })
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::scene::Shape;
    use crate::scene::{AnalyticShape, Sphere};
    use glam::DVec3;

    /// Spheres with these names.
    fn scene(names: &[&str]) -> Scene {
        let sphere = |x: usize| {
            let centre = DVec3::new(x as f64, 0.0, 0.0);
            Shape::Analytic(AnalyticShape::Sphere(Sphere { centre, radius: 0.25 }))
        };
        let mut scene: Scene = (0..names.len()).map(sphere).collect();
        scene.objects.iter_mut().zip(names).for_each(|(object, name)| object.name = (*name).to_owned());
        scene
    }

    fn visible(scene: &Scene) -> Vec<&str> {
        scene.objects.iter().map(|object| object.name.as_str()).collect()
    }

    #[test]
    fn names_hide_and_isolate_objects_and_their_parts() {
        let names = ["lamp", "desk/top", "desk/leg", "desktop", "lamp"];
        let list = |names: &[&str]| names.iter().map(|name| (*name).to_owned()).collect::<Vec<_>>();
        let mut scene = scene(&names);
        for (isolate, hide, shown) in [
            (&[][..], &["desk"][..], &["lamp", "desktop", "lamp"][..]),
            (&[], &["lamp", "desk/leg"], &["desk/top", "desktop"]),
            (&["desk"], &[], &["desk/top", "desk/leg"]),
            (&["desk", "lamp"], &["desk/top"], &["lamp", "desk/leg", "lamp"]),
            (&[], &[], &names),
        ] {
            scene.set_visible(&list(isolate), &list(hide)).unwrap();
            assert_eq!(visible(&scene), shown);
            let all: Vec<&str> = scene.all_objects().map(|(object, _)| object.name.as_str()).collect();
            assert_eq!(all, names);
            let flags = scene.all_objects().filter(|(_, is_visible)| *is_visible).count();
            assert_eq!(flags, shown.len());
        }
        for (isolate, hide, message) in [
            (&[][..], &["dsk"][..], "--hide: no object is named `dsk`"),
            (&["des"], &[], "--isolate: no object is named `des`"),
            (&["desk"], &["desk"], "--hide leaves no object in the picture"),
        ] {
            let e = scene.set_visible(&list(isolate), &list(hide)).unwrap_err();
            assert_eq!(e.to_string(), message);
            assert_eq!(visible(&scene), names);
        }
    }

    /// Scenes that hide something can be put together: the order of all objects is that of the scenes.
    #[test]
    fn appended_scenes_keep_what_they_hide() {
        let [mut a, mut b] = [scene(&["a", "b"]), scene(&["c", "d"])];
        a.set_visible(&[], &["a".into()]).unwrap();
        b.set_visible(&["d".into()], &[]).unwrap();
        a.append(b);
        assert_eq!(visible(&a), ["b", "d"]);
        let all: Vec<(&str, bool)> = a.all_objects().map(|(o, shown)| (o.name.as_str(), shown)).collect();
        assert_eq!(all, [("a", false), ("b", true), ("c", false), ("d", true)]);
        assert_eq!(a.show_all(), [0, 2]);
        assert_eq!(visible(&a), ["a", "b", "c", "d"]);
    }
}
