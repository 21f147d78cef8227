//! 3MF files made by hand.

use std::io::Write;

use glam::{DVec2, DVec3};

use crate::film::Colour;
use crate::import::formats::threemf::*;

/// A ZIP archive of parts.
fn archive(parts: &[(&str, &[u8])]) -> Vec<u8> {
    let mut out = Vec::new();
    let mut archive = rawzip::ZipArchiveWriter::new(&mut out);
    for (name, bytes) in parts {
        let start = archive.new_file(name).compression_method(rawzip::CompressionMethod::DEFLATE).start();
        let (mut entry, config) = start.expect("a name");
        let level = flate2::Compression::default();
        let mut writer = config.wrap(flate2::write::DeflateEncoder::new(&mut entry, level));
        writer.write_all(bytes).expect("memory");
        let (encoder, descriptor) = writer.finish().expect("memory");
        encoder.finish().expect("memory");
        entry.finish(descriptor).expect("memory");
    }
    archive.finish().expect("memory");
    out
}

fn load(bytes: Vec<u8>) -> Result<(Scene, Warnings)> {
    let mut warnings = Warnings::default();
    let source = Source::of("a.3mf", bytes);
    Ok((read(&source, &mut warnings)?, warnings))
}

fn model(attributes: &str, resources: &str, build: &str) -> String {
    format!(
        "<?xml version=\"1.0\" encoding=\"UTF-8\"?>\n<model {attributes} \
         xmlns=\"http://schemas.microsoft.com/3dmanufacturing/core/2015/02\" \
         xmlns:m=\"http://schemas.microsoft.com/3dmanufacturing/material/2015/02\" \
         xmlns:p=\"http://schemas.microsoft.com/3dmanufacturing/production/2015/06\">\n\
         <metadata name=\"Title\">Two &amp; more</metadata>\n\
         <resources>{resources}</resources>\n<build>{build}</build></model>"
    )
}

fn package(model: &str) -> Vec<u8> {
    archive(&[("3D/3dmodel.model", model.as_bytes())])
}

/// A mesh of two triangles, with attributes of each.
fn mesh(first: &str, second: &str) -> String {
    format!(
        "<mesh><vertices><vertex x=\"0\" y=\"0\" z=\"0\"/><vertex x=\"1\" y=\"0\" z=\"0\"/>\
         <vertex x=\"1\" y=\"2\" z=\"0\"/><vertex x=\"0\" y=\"2e0\" z=\"0\"/></vertices><triangles>\
         <triangle v1=\"0\" v2=\"1\" v3=\"2\" {first}/><triangle v1=\"0\" v2=\"2\" v3=\"3\" {second}/>\
         </triangles></mesh>"
    )
}

fn object(attributes: &str, content: &str) -> String {
    format!("<object {attributes}>{content}</object>")
}

const ITEM: &str = "<item objectid=\"1\"/>";

fn corners(scene: &Scene, index: usize) -> [DVec3; 3] {
    match &scene.objects[index].shape {
        Shape::Placed(placed) => placed.corners_of(0),
        _ => panic!("a placed mesh"),
    }
}

fn part(scene: &Scene, index: usize) -> (&Mesh, &Phong) {
    let Object { shape: Shape::Placed(placed), material, .. } = &scene.objects[index] else {
        panic!("placed")
    };
    let Material::Phong(material) = &scene.materials[material.0 as usize] else { panic!("Phong") };
    (&placed.mesh, material)
}

/// A component rotated by 90 degrees about z (x to y) and moved by (10, 0, 0), in an item that doubles, in inches: the
/// corner (1, 2, 0) goes to (-2, 1, 0), (8, 1, 0), (16, 2, 0), and 25.4 times that.
#[test]
fn units_items_and_components() {
    let component =
        "<components><component objectid=\"1\" transform=\"0 1 0 -1 0 0 0 0 1 10 0 0\"/></components>";
    let resources = object("id=\"1\" name=\"plate\"", &mesh("", "")) + &object("id=\"2\"", component);
    let build = "<item objectid=\"2\" transform=\"2 0 0 0 2 0 0 0 2 0 0 0\"/><item objectid=\"1\" \
                 transform=\"-1 0 0 0 1 0 0 0 1 0 0 0\"/>";
    let (scene, warnings) = load(package(&model("unit=\"inch\"", &resources, build))).expect("two items");
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(scene.objects.iter().map(|o| o.name.as_str()).collect::<Vec<_>>(), ["plate"; 2]);
    let turned = corners(&scene, 0)[2];
    assert!((turned - DVec3::new(16.0, 2.0, 0.0) * 25.4).length() < 1e-12, "{turned}");
    // A mirrored object keeps its front side.
    assert_eq!(scene.objects.iter().map(|o| o.shape.is_mirrored()).collect::<Vec<_>>(), [false, true]);
    assert_eq!(scene.metadata, [("Title".into(), "Two & more".into())]);
}

#[test]
fn colours_of_materials_and_groups() {
    let resources = "<basematerials id=\"5\"><base name=\"a\" displaycolor=\"#FF0000\"/>\
                     <base name=\"b\" displaycolor=\"#0000FF33\"/></basematerials>\
                     <m:colorgroup id=\"6\"><m:color color=\"#00FF00FF\"/><m:color color=\"#FFFFFF\"/></m:colorgroup>"
        .to_owned();
    let own = object("id=\"1\" pid=\"5\" pindex=\"1\"", &mesh("pid=\"6\" p1=\"0\" p2=\"1\" p3=\"0\"", ""));
    let (scene, warnings) = load(package(&model("", &(resources + &own), ITEM))).expect("an item");
    assert!(warnings.is_empty(), "{warnings:?}");
    let (mesh, material) = part(&scene, 0);
    let colours = mesh.colours.as_ref().expect("colours");
    let of = |triangle: usize| {
        colours.triangles.as_ref().expect("corners")[triangle].map(|i| colours.values[i as usize])
    };
    assert_eq!([of(0), of(1)], [[DVec3::Y, DVec3::ONE, DVec3::Y], [DVec3::Z; 3]]);
    let alphas = mesh.alphas.as_ref().expect("opacities");
    let last = alphas.triangles.as_ref().expect("corners")[1][0] as usize;
    assert_eq!(alphas.values[last], 0.2);
    assert_eq!((material.colour, material.opacity.is_some()), (Colour::Display(DVec3::ONE), true));
    // Without properties: the default.
    let (scene, _) = load(package(&model(
        "",
        &object("id=\"1\"", &crate::import::formats::threemf::tests::mesh("", "")),
        ITEM,
    )))
    .expect("an item");
    let (mesh, material) = part(&scene, 0);
    assert_eq!((mesh.colours.is_none(), material.colour), (true, Colour::from_u8([204; 3])));
}

/// v points up in the image: (0.25, 0.75) of the file is 0.25 from the top.
#[test]
fn images_of_the_package() {
    let mut png = std::io::Cursor::new(Vec::new());
    let pixels = image::RgbImage::from_raw(1, 1, vec![0, 255, 0]).expect("a pixel");
    pixels.write_to(&mut png, image::ImageFormat::Png).expect("memory");
    let resources = "<m:texture2d id=\"7\" path=\"/3D/Textures/a.png\" contenttype=\"image/png\" tilestyleu=\"mirror\"/>\
                     <m:texture2dgroup id=\"8\" texid=\"7\"><m:tex2coord u=\"0.25\" v=\"0.75\"/></m:texture2dgroup>"
        .to_owned();
    let own = object("id=\"1\"", &mesh("pid=\"8\" p1=\"0\"", ""));
    let text = model("", &(resources + &own), ITEM);
    let bytes = archive(&[("3D/3dmodel.model", text.as_bytes()), ("3D/Textures/A.png", png.get_ref())]);
    let (scene, warnings) = load(bytes).expect("an item");
    assert!(warnings.is_empty(), "{warnings:?}");
    assert_eq!(scene.objects.len(), 2);
    assert!(part(&scene, 0).1.textures[TextureSlot::BaseColour].is_none());
    let (mesh, material) = part(&scene, 1);
    let texture = material.textures[TextureSlot::BaseColour].expect("a texture");
    assert_eq!(texture.sampler.wrap_u, Wrap::MirroredRepeat);
    let pixels: Vec<[u16; 3]> = scene.images[texture.image.0 as usize].pixels.iter().collect();
    assert_eq!(pixels, [[0, 255, 0]]);
    assert_eq!(mesh.uvs[0].values[0], DVec2::new(0.25, 0.25));
    let (scene, warnings) = load(package(&text)).expect("an item");
    assert!(scene.images.is_empty() && format!("{warnings:?}").contains("not in the file"), "{warnings:?}");
}

/// Two textures of one image, each with its own wrap modes, in one object and in every run.
#[test]
fn textures_of_one_image_have_their_own_wrap_modes() {
    let mut png = std::io::Cursor::new(Vec::new());
    let pixels = image::RgbImage::from_raw(1, 1, vec![0, 255, 0]).expect("a pixel");
    pixels.write_to(&mut png, image::ImageFormat::Png).expect("memory");
    let texture = |id: u32, style: &str| {
        format!(
            "<m:texture2d id=\"{id}\" path=\"/3D/a.png\" contenttype=\"image/png\" tilestyleu=\"{style}\"/>\
             <m:texture2dgroup id=\"{}\" texid=\"{id}\"><m:tex2coord u=\"4\" v=\"0\"/></m:texture2dgroup>",
            id + 10
        )
    };
    let own = object("id=\"1\"", &mesh("pid=\"12\" p1=\"0\"", "pid=\"13\" p1=\"0\""));
    let text = model("", &(texture(2, "clamp") + &texture(3, "mirror") + &own), ITEM);
    let bytes = archive(&[("3D/3dmodel.model", text.as_bytes()), ("3D/a.png", png.get_ref())]);
    // The order of a hash map differs from run to run, and from map to map.
    for _ in 0..16 {
        let (scene, _) = load(bytes.clone()).expect("an item");
        assert_eq!((scene.objects.len(), scene.images.len()), (2, 1));
        let wraps = [0, 1].map(|index| {
            let (mesh, material) = part(&scene, index);
            (
                mesh.triangles[0][1],
                material.textures[TextureSlot::BaseColour].expect("a texture").sampler.wrap_u,
            )
        });
        // Each part has the triangle of its texture: the second corner of the first is 1, of the second 2.
        let of = |wrap: Wrap| part_of_wrap(&scene, wrap).positions[1];
        assert_eq!(of(Wrap::ClampToEdge), DVec3::new(1.0, 0.0, 0.0), "{wraps:?}");
        assert_eq!(of(Wrap::MirroredRepeat), DVec3::new(1.0, 2.0, 0.0), "{wraps:?}");
    }
}

/// The mesh of the object whose texture has this wrap mode.
fn part_of_wrap(scene: &Scene, wrap: Wrap) -> &Mesh {
    let parts = (0..scene.objects.len()).map(|index| part(scene, index));
    let mut of_wrap = parts.filter(|(_, material)| {
        material.textures[TextureSlot::BaseColour].is_some_and(|texture| texture.sampler.wrap_u == wrap)
    });
    of_wrap.next().expect("a part of the wrap mode").0
}

/// Items and components count as nodes where they stand, also those of objects that are not placed.
#[test]
fn lists_are_limited_while_they_are_read() {
    let options = crate::scene::ImportOptions {
        limits: crate::limits::Limits::DEFAULT.with(Counted::Nodes, 1000).with(Counted::Triangles, 3),
        ..Default::default()
    };
    let fault = |resources: &str, build: &str| {
        let bytes = package(&model("", resources, build));
        let source = Source { options: options.clone(), ..Source::of("a.3mf", bytes) };
        read(&source, &mut Warnings::default()).expect_err("too many").to_string()
    };
    let components = "<component objectid=\"1\"/>".repeat(1001);
    let unused = object("id=\"2\"", &format!("<components>{components}</components>"));
    // The last item is invalid, but not read any more.
    let items = ITEM.repeat(1001) + "<item/>";
    let plain = object("id=\"1\"", &mesh("", ""));
    for (resources, build) in [(&unused, ""), (&String::new(), items.as_str())] {
        assert_eq!(fault(resources, build), "a.3mf: 1001 nodes; the limit is 1000");
    }
    let two = plain.clone() + &plain.replace("id=\"1\"", "id=\"3\"");
    assert_eq!(fault(&two, ""), "a.3mf: 4 triangles; the limit is 3");
}

/// The relationships name the model, and components stand in another part, as slicers write them.
#[test]
fn parts_of_the_package() {
    let relationships = "<Relationships><Relationship Target=\"/3D/other.model\" Id=\"r\" \
                         Type=\"http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel\"/></Relationships>";
    let component = "<components><component p:path=\"/3D/Objects/a.model\" objectid=\"1\"/></components>";
    let root = model("", &object("id=\"2\"", component), "<item objectid=\"2\"/>");
    let inner = model("", &object("id=\"1\"", &mesh("", "")), "");
    let bytes = archive(&[
        ("_rels/.rels", relationships.as_bytes()),
        ("3D/other.model", root.as_bytes()),
        ("3D/Objects/a.model", inner.as_bytes()),
    ]);
    assert_eq!(load(bytes).expect("a component").0.objects.len(), 1);
}

#[test]
fn what_is_no_model_is_named() {
    let resources = object("id=\"1\" type=\"support\"", &mesh("", ""));
    let (scene, warnings) = load(package(&model("", &resources, ITEM))).expect("no object");
    assert!(scene.objects.is_empty());
    assert_eq!(warnings.all_left_out(), ["a.3mf: left out object 1 of the type `support`"]);
}

/// A model of two objects of two triangles, and one of both as components, with files of settings beside it.
fn sliced(build: &str, files: &[(&str, &str)]) -> (Scene, Warnings) {
    let components = "<components><component objectid=\"1\"/><component objectid=\"2\"/></components>";
    let both = [object("id=\"1\"", &mesh("", "")), object("id=\"2\"", &mesh("", ""))].concat();
    let text = model("", &(both + &object("id=\"3\"", components)), build);
    let mut parts = vec![("3D/3dmodel.model", text.as_bytes())];
    parts.extend(files.iter().map(|(name, text)| (*name, text.as_bytes())));
    load(archive(&parts)).expect("a model")
}

/// The number of triangles of each object.
fn counts(scene: &Scene) -> Vec<usize> {
    scene.objects.iter().map(|object| object.shape.primitive_count()).collect()
}

/// What slicers do not print as a part of the model is left out, with a note: components by their subtype, triangles of
/// volumes, with their vertices, objects by a setting, and build items.
#[test]
fn parts_that_are_not_printed_are_left_out() {
    let all = "<item objectid=\"3\"/>";
    assert_eq!(counts(&sliced(all, &[]).0), [2, 2]);
    let roles = [
        ("modifier_part", "ParameterModifier", "modifier"),
        ("negative_part", "NegativeVolume", "negative volume"),
        ("support_blocker", "SupportBlocker", "support blocker"),
        ("support_enforcer", "SupportEnforcer", "support enforcer"),
    ];
    for (subtype, volume, role) in roles {
        let settings = format!(
            "<config><object id=\"3\"><part id=\"1\" subtype=\"normal_part\"/><part id=\"2\" subtype=\"{subtype}\">\
             <metadata key=\"name\" value=\"b\"/></part></object></config>"
        );
        let (scene, warnings) = sliced(all, &[("Metadata/model_settings.config", &settings)]);
        assert_eq!(counts(&scene), [2]);
        assert_eq!(warnings.all_left_out(), [format!("a.3mf: left out object 2, a {role}")]);
        let metadata = |value: &str| format!("<metadata key=\"volume_type\" value=\"{value}\"/>");
        let settings = format!(
            "<config><object id=\"1\"><volume firstid=\"0\" lastid=\"0\">{}</volume>\
             <volume firstid=\"1\" lastid=\"1\">{}</volume></object></config>",
            metadata("ModelPart"),
            metadata(volume)
        );
        let (scene, warnings) = sliced(all, &[("Metadata/Slic3r_PE_model.config", &settings)]);
        assert_eq!(counts(&scene), [1, 2]);
        assert_eq!(scene.objects[0].shape.mesh().map(|mesh| mesh.positions.len()), Some(3));
        assert_eq!(warnings.all_left_out(), [format!("a.3mf: left out 1 triangle(s) of object 1, a {role}")]);
    }
    // PrusaSlicer before version 2.
    let settings = "<config><object id=\"1\"><volume firstid=\"1\" lastid=\"1\"><metadata key=\"modifier\" value=\"1\"/>\
                    </volume></object></config>";
    assert_eq!(counts(&sliced(all, &[("Metadata/Slic3r_PE_model.config", settings)]).0), [1, 2]);
    let (scene, warnings) = sliced("<item objectid=\"1\"/><item objectid=\"2\" printable=\"0\"/>", &[]);
    assert_eq!(counts(&scene), [2]);
    assert_eq!(warnings.all_left_out(), ["a.3mf: left out object 2, which is not to be printed"]);
    let (scene, warnings) = sliced(all, &[("Metadata/model_settings.config", "<config><object id=\"3\"")]);
    assert_eq!((counts(&scene), warnings.messages().len()), (vec![2, 2], 1));
    let cura = "<metadatagroup><metadata name=\"cura:infill_mesh\">True</metadata></metadatagroup>";
    let resources = object("id=\"1\"", &format!("{cura}{}", mesh("", "")));
    let (scene, warnings) = load(package(&model("", &resources, ITEM))).expect("no object");
    assert!(scene.objects.is_empty());
    assert_eq!(warnings.all_left_out(), ["a.3mf: left out object 1 of the type `modifier`"]);
}

/// The colour of each triangle's first corner, in display values.
fn colours_of(scene: &Scene) -> Vec<[f64; 3]> {
    let meshes = scene.objects.iter().filter_map(|object| object.shape.mesh());
    let colours = meshes.flat_map(|mesh| {
        let colours = mesh.colours.as_ref().expect("colours");
        let corners = colours.triangles.as_ref().expect("colours of corners");
        corners.iter().map(|corners| colours.values[corners[0] as usize].to_array()).collect::<Vec<_>>()
    });
    colours.collect()
}

/// Parts have the colours of their filaments, or of their object's; painted triangles those of the paint: `8` is
/// filament 2, `0C` is 3, as 12 means 3 and the next digit. A triangle that is painted in parts has more digits.
#[test]
fn filaments_colour_parts_and_painted_triangles() {
    const RED: [f64; 3] = [1.0, 0.0, 0.0];
    const GREEN: [f64; 3] = [0.0, 1.0, 0.0];
    const BLUE: [f64; 3] = [0.0, 0.0, 1.0];
    let build = "<item objectid=\"3\"/>";
    let parts = "<config><object id=\"3\"><metadata key=\"extruder\" value=\"2\"/><part id=\"1\"/>\
                 <part id=\"2\"><metadata key=\"extruder\" value=\"1\"/></part></object></config>";
    let project = "{\"filament_colour\": [\"#FF0000\", \"#00FF00\", \"#0000FFFF\"], \"other\": {\"a\": [1]}}";
    let (scene, warnings) = sliced(
        build,
        &[("Metadata/model_settings.config", parts), ("Metadata/project_settings.config", project)],
    );
    assert_eq!(colours_of(&scene), [GREEN, GREEN, RED, RED]);
    assert!(warnings.is_empty(), "{warnings:?}");
    let volumes = "<config><object id=\"1\"><metadata type=\"object\" key=\"extruder\" value=\"3\"/>\
                   <volume firstid=\"1\" lastid=\"1\"><metadata key=\"extruder\" value=\"2\"/></volume></object></config>";
    let print =
        "; comment\n; extruder_colour = \"\";;#0000FF\r\n; filament_colour = #FF0000;#00FF00;#FFFFFF\n";
    let files = [("Metadata/Slic3r_PE_model.config", volumes), ("Metadata/Slic3r_PE.config", print)];
    assert_eq!(colours_of(&sliced(build, &files).0), [BLUE, GREEN, RED, RED]);
    let painted = |first: &str, second: &str, files: &[(&str, &str)]| {
        let text = model("", &object("id=\"1\"", &mesh(first, second)), ITEM);
        let mut parts = vec![("3D/3dmodel.model", text.as_bytes())];
        parts.extend(files.iter().map(|(name, text)| (*name, text.as_bytes())));
        load(archive(&parts)).expect("a model")
    };
    let files = [("Metadata/project_settings.config", project)];
    let (scene, _) = painted("paint_color=\"8\"", "xmlns:s=\"s\" s:mmu_segmentation=\"0C\"", &files);
    assert_eq!(colours_of(&scene), [GREEN, BLUE]);
    let (scene, warnings) = painted("paint_color=\"4481\"", "paint_color=\"0\"", &files);
    assert_eq!(colours_of(&scene), [RED, RED]);
    assert_eq!(warnings.messages(), ["a.3mf: left out: colours painted on parts of triangles"]);
    let (scene, warnings) = painted("paint_color=\"8\"", "", &[]);
    assert!(scene.objects[0].shape.mesh().is_some_and(|mesh| mesh.colours.is_none()));
    assert_eq!(warnings.messages(), ["a.3mf: left out: painted colours"]);
}

/// Names of parts are URIs, in which a space is `%20`. Objects of a part that is missing are left out, with a warning.
#[test]
fn parts_are_found_by_their_uris() {
    let relationships = format!(
        "<Relationships><Relationship Target=\"/3D/part%20one.model\" Id=\"rel0\" Type=\"{}\"/></Relationships>",
        "http://schemas.microsoft.com/3dmanufacturing/2013/01/3dmodel"
    );
    let path = |path: &str| format!("<item objectid=\"1\" p:path=\"{path}\"/>");
    let root = model("", "", &(path("/3D/%C3%A9.model") + &path("/3D/gone.model").repeat(2)));
    let inner = model("", &object("id=\"1\"", &mesh("", "")), "");
    let bytes = archive(&[
        ("_rels/.rels", relationships.as_bytes()),
        ("3D/part one.model", root.as_bytes()),
        ("3D/\u{e9}.model", inner.as_bytes()),
    ]);
    let (scene, warnings) = load(bytes).expect("an object");
    assert_eq!(counts(&scene), [2]);
    assert_eq!(warnings.messages(), ["a.3mf: /3D/gone.model: left out: not in the file"]);
}

#[test]
fn faults_name_their_part() {
    let text = |bytes: Vec<u8>| load(bytes).map(drop).expect_err("it is broken").to_string();
    let of = |resources: &str, build: &str| text(package(&model("", resources, build)));
    assert!(text(b"PK\x03\x04".to_vec()).contains("not a whole ZIP archive"));
    assert!(text(archive(&[("a.txt", b"a")])).contains("without a 3D model"));
    assert_eq!(of("", ITEM), "a.3mf: 3D/3dmodel.model, object 1: does not exist");
    let cycle = "<components><component objectid=\"1\"/></components>";
    assert!(of(&object("id=\"1\"", cycle), ITEM).contains("nested more than 64 times"));
    let beyond = mesh("", "").replace("v1=\"0\"", "v1=\"4\"");
    let what = "triangle 0 has a vertex index beyond 4 vertices";
    assert_eq!(of(&object("id=\"1\"", &beyond), ITEM), format!("a.3mf: 3D/3dmodel.model, object 1: {what}"));
    assert!(of("", "<item objectid=\"1\" transform=\"1 2\"/>").contains("is not 12 numbers"));
    let whole = model("", "", "");
    assert!(text(package(&whole[..whole.len() - 9])).contains("3D/3dmodel.model: "));
    assert!(text(package(&whole.replace("<model ", "<model unit=\"ell\" "))).contains("unknown unit"));
    // Levels of two components each have more placements than the limit.
    let levels: String = (2..40)
        .map(|id| {
            let component = format!("<component objectid=\"{}\"/>", id - 1);
            object(&format!("id=\"{id}\""), &format!("<components>{component}{component}</components>"))
        })
        .collect();
    let resources = object("id=\"1\"", &mesh("", "")) + &levels;
    let mut warnings = Warnings::default();
    let options = crate::scene::ImportOptions {
        limits: crate::limits::Limits::DEFAULT.with(Counted::Nodes, 1000),
        ..Default::default()
    };
    let bytes = package(&model("", &resources, "<item objectid=\"39\"/>"));
    let source = Source { options, ..Source::of("a.3mf", bytes) };
    let error = read(&source, &mut warnings).expect_err("too many").to_string();
    assert_eq!(error, "a.3mf: 1001 nodes; the limit is 1000");
}

/// Wrong sizes in the directory: too small for the part, and above the memory limit.
#[test]
fn sizes_are_checked() {
    let bytes = package(&model("", &object("id=\"1\"", &mesh("", "")), ITEM));
    let directory = bytes.windows(4).rposition(|word| word == b"PK\x01\x02").expect("a directory");
    let claim = |size: u32| {
        let mut bytes = bytes.clone();
        bytes[directory + 24..directory + 28].copy_from_slice(&size.to_le_bytes());
        load(bytes).map(drop).expect_err("a wrong size").to_string()
    };
    assert!(claim(10).contains("3D/3dmodel.model: "), "{}", claim(10));
    assert!(claim(u32::MAX - 1).contains("3D/3dmodel.model: "), "{}", claim(u32::MAX - 1));
}
