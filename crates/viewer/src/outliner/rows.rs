//! The rows of the list of objects: objects by their names, and groups of names with a common beginning before a `/`.

use std::collections::HashMap;

use kiln::scene::{ImportOptions, Scene, is_named};

/// Names of materials that a row lists.
const MATERIALS: usize = 8;

/// The objects of a name and of its parts.
#[derive(Debug, Default, Clone, PartialEq)]
pub(super) struct Row {
    /// The name.
    pub name: String,
    /// Where the part of the name begins that the group above does not have.
    pub label: usize,
    /// Number of groups above.
    pub depth: usize,
    /// The group above.
    pub parent: Option<usize>,
    /// The end of the rows of its parts, which follow it.
    pub end: usize,
    /// Whether there are such rows.
    pub is_group: bool,
    /// Number of objects, and of those that are visible.
    pub parts: usize,
    pub shown: usize,
    /// Number of triangles and analytic shapes.
    pub triangles: usize,
    /// Names of their materials, each once.
    pub materials: Vec<String>,
}

/// The rows of a scene: each name of objects once, and each beginning of several names, before its parts.
pub(super) fn rows(scene: &Scene) -> Vec<Row> {
    let mut found: Vec<Row> = Vec::new();
    let mut places = HashMap::<&str, usize>::new();
    // For each, whether an object has the whole name, and the number of different names one `/` longer.
    let (mut is_whole, mut longer): (Vec<bool>, Vec<usize>) = Default::default();
    for (object, is_visible) in scene.all_objects() {
        let material = scene.materials[object.material.0 as usize].name();
        let mut parent = None;
        let ends = object.name.match_indices('/').map(|(end, _)| end).chain([object.name.len()]);
        for end in ends {
            let name = &object.name[..end];
            let place = *places.entry(name).or_insert_with(|| {
                found.push(Row { name: name.to_owned(), parent, ..Row::default() });
                is_whole.push(false);
                longer.push(0);
                if let Some(parent) = parent {
                    longer[parent] += 1;
                }
                found.len() - 1
            });
            let row = &mut found[place];
            row.parts += 1;
            row.shown += usize::from(is_visible);
            row.triangles += object.shape.primitive_count();
            if row.materials.len() < MATERIALS && !row.materials.iter().any(|known| known == material) {
                row.materials.push(material.to_owned());
            }
            is_whole[place] |= end == object.name.len();
            parent = Some(place);
        }
    }
    // Children of each row that is listed, in the order of the scene; the last entry has those without a parent.
    let mut children = vec![Vec::new(); found.len() + 1];
    for place in (0..found.len()).filter(|&place| is_whole[place] || longer[place] > 1) {
        let is_listed = |at: &usize| is_whole[*at] || longer[*at] > 1;
        let above = std::iter::successors(found[place].parent, |&at| found[at].parent).find(is_listed);
        children[above.unwrap_or(found.len())].push(place);
    }
    let mut rows = Vec::new();
    let top = children[found.len()].clone();
    top.into_iter().for_each(|place| add(&mut rows, None, place, &mut found, &children));
    rows
}

/// Adds a row and its parts.
fn add(rows: &mut Vec<Row>, parent: Option<usize>, place: usize, found: &mut [Row], children: &[Vec<usize>]) {
    let own = rows.len();
    let (depth, label) =
        parent.map_or((0, 0), |parent| (rows[parent].depth + 1, rows[parent].name.len() + 1));
    rows.push(Row { parent, depth, label, ..std::mem::take(&mut found[place]) });
    children[place].iter().for_each(|&child| add(rows, Some(own), child, found, children));
    rows[own].end = rows.len();
    rows[own].is_group = rows.len() > own + 1;
}

/// The names that are isolated and hidden once the objects of a row are visible or not.
pub(super) fn toggled(
    rows: &[Row],
    options: &ImportOptions,
    index: usize,
    is_visible: bool,
) -> [Vec<String>; 2] {
    let ImportOptions { isolate, hide, .. } = options;
    let name = &rows[index].name;
    let is_within = |name: &str, names: &[String]| names.iter().any(|other| is_named(name, other));
    let mut isolate = isolate.clone();
    if is_visible && !isolate.is_empty() && !is_within(name, &isolate) {
        isolate.retain(|part| !is_named(part, name));
        isolate.push(name.clone());
    }
    let is_hidden = |leaf: &Row| {
        if is_named(&leaf.name, name) { !is_visible } else { is_within(&leaf.name, hide) }
    };
    // The names of whole groups where all their parts are hidden.
    let (mut hide, mut at) = (Vec::new(), 0);
    while at < rows.len() {
        let mut leaves = rows[at..rows[at].end].iter().filter(|row| !row.is_group);
        if leaves.all(is_hidden) {
            hide.push(rows[at].name.clone());
            at = rows[at].end;
        } else {
            at += 1;
        }
    }
    [isolate, hide]
}

/// The names that are isolated and hidden once a name is isolated.
pub(super) fn isolated(hide: &[String], name: &str) -> [Vec<String>; 2] {
    let is_other = |hidden: &&String| !is_named(hidden, name) && !is_named(name, hidden);
    [vec![name.to_owned()], hide.iter().filter(is_other).cloned().collect()]
}

#[cfg(test)]
mod tests {
    use super::*;
    use glam::DVec3;
    use kiln::bvh::{AnalyticShape, Sphere};
    use kiln::scene::Shape;

    /// Spheres with these names.
    fn scene(names: &[&str]) -> Scene {
        let sphere = AnalyticShape::Sphere(Sphere { centre: DVec3::ZERO, radius: 1.0 });
        let mut scene: Scene = names.iter().map(|_| Shape::Analytic(sphere)).collect();
        scene.objects.iter_mut().zip(names).for_each(|(object, name)| object.name = (*name).to_owned());
        scene
    }

    const NAMES: [&str; 7] =
        ["room/desk/top", "lamp", "room/desk/leg", "room/desk/leg", "a/b", "room/door", "lamp"];

    /// Groups are before their parts, in the order of the scene; `room/desk` and `room` have several parts, `a` one.
    #[test]
    fn names_with_a_common_beginning_are_a_group() {
        let rows = rows(&scene(&NAMES));
        let labels: Vec<(usize, &str, usize)> =
            rows.iter().map(|row| (row.depth, &row.name[row.label..], row.parts)).collect();
        let expected = [
            (0, "room", 4),
            (1, "desk", 3),
            (2, "top", 1),
            (2, "leg", 2),
            (1, "door", 1),
            (0, "lamp", 2),
            (0, "a/b", 1),
        ];
        assert_eq!(labels, expected);
        let ends: Vec<(bool, usize)> = rows.iter().map(|row| (row.is_group, row.end)).collect();
        let [group, leaf] = [true, false];
        assert_eq!(ends, [(group, 5), (group, 4), (leaf, 3), (leaf, 4), (leaf, 5), (leaf, 6), (leaf, 7)]);
        assert_eq!(rows.iter().map(|row| row.triangles).collect::<Vec<_>>(), [4, 3, 1, 2, 1, 2, 1]);
    }

    /// What the chosen names show is what was clicked, and they are as few as possible.
    #[test]
    fn what_is_clicked_is_shown_or_hidden_and_nothing_else() {
        let mut scene = scene(&NAMES);
        // Each click: the row, whether it is to be visible, the names then hidden, and the objects then visible.
        let click = |scene: &mut Scene, name: &str, is_visible: bool| {
            let rows = rows(scene);
            let index = rows.iter().position(|row| row.name == name).expect("a row");
            let [isolate, hide] = toggled(&rows, &scene.import_options, index, is_visible);
            scene.set_visible(&isolate, &hide).expect("known names");
            (scene.import_options.isolate, scene.import_options.hide) = (isolate, hide);
            let flags: String = scene.all_objects().map(|(_, shown)| if shown { 'x' } else { '.' }).collect();
            (scene.import_options.isolate.join(" "), scene.import_options.hide.join(" "), flags)
        };
        let said = |isolate: &str, hide: &str, flags: &str| (isolate.into(), hide.into(), flags.into());
        assert_eq!(click(&mut scene, "room/desk/leg", false), said("", "room/desk/leg", "xx..xxx"));
        assert_eq!(click(&mut scene, "room/desk/top", false), said("", "room/desk", ".x..xxx"));
        assert_eq!(click(&mut scene, "room", false), said("", "room", ".x..x.x"));
        assert_eq!(click(&mut scene, "room/door", true), said("", "room/desk", ".x..xxx"));
        assert_eq!(click(&mut scene, "room/desk/top", true), said("", "room/desk/leg", "xx..xxx"));
        [scene.import_options.isolate, scene.import_options.hide] =
            isolated(&scene.import_options.hide, "room/desk");
        assert_eq!(click(&mut scene, "room/desk/top", false), said("room/desk", "room/desk/top", "..xx..."));
        assert_eq!(click(&mut scene, "lamp", true), said("room/desk lamp", "room/desk/top", ".xxx..x"));
    }
}
