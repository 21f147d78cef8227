//! Parser of the XML of a model.

use std::collections::{BTreeSet, HashMap};

use glam::{DMat4, DVec2, DVec3, DVec4};
use quick_xml::XmlVersion;
use quick_xml::escape::resolve_predefined_entity;
use quick_xml::events::{BytesStart, Event};

use crate::error::{Error, Place, Result};
use crate::import::Source;
use crate::import::formats::threemf::package::Package;
use crate::import::formats::threemf::slicer::role;
use crate::import::text::lines::parse_number;
use crate::limits::{self, Bytes, Counted};
use crate::scene::Wrap;

/// Resources of a model by id, and its build.
#[derive(Default)]
pub(super) struct Model {
    /// Millimetres per unit of length.
    pub unit: f64,
    pub objects: HashMap<u32, Definition>,
    pub properties: HashMap<u32, Property>,
    pub textures: HashMap<u32, TextureFile>,
    pub items: Vec<Reference>,
    pub metadata: Vec<(String, String)>,
    /// Kinds of content that are not supported.
    pub left_out: BTreeSet<&'static str>,
    /// Whether triangles have the colours of filaments.
    pub is_painted: bool,
}

/// The property group of triangles that are painted with the filament of their index; ids of groups are not 0.
pub(super) const FILAMENT: u32 = 0;

#[derive(Default)]
pub(super) struct Definition {
    pub name: Option<String>,
    /// Type of an object that is not part of the model.
    pub other_type: Option<&'static str>,
    pub positions: Vec<DVec3>,
    pub triangles: Vec<[u32; 3]>,
    /// Property group per triangle, or [`FILAMENT`], and index per corner.
    pub properties: Vec<Option<(u32, [u32; 3])>>,
    /// Parts of an object without triangles.
    pub components: Vec<Reference>,
}

/// Item of the build or component: an object and a transform.
pub(super) struct Reference {
    pub object: u32,
    /// Part of the package, if it is another one.
    pub path: Option<String>,
    pub transform: DMat4,
    /// `false` for build items that slicers do not print.
    pub is_printable: bool,
}

pub(super) enum Property {
    /// Red, green, blue and alpha, display values.
    Colours(Vec<[u8; 4]>),
    Coordinates {
        texture: u32,
        uvs: Vec<DVec2>,
    },
}

/// Image of a `texture2d`.
pub(super) struct TextureFile {
    /// Part of the package.
    pub path: String,
    pub wrap: [Wrap; 2],
}

/// Valid attributes of an element, by local name.
pub(super) fn attributes<'a>(e: &'a BytesStart) -> impl Iterator<Item = (Vec<u8>, String)> + 'a {
    e.attributes().flatten().filter_map(|attribute| {
        let value = attribute.normalized_value(XmlVersion::Implicit1_0).ok()?;
        Some((attribute.key.local_name().as_ref().to_vec(), value.into_owned()))
    })
}

/// Attributes of one element; numbers are read without allocation.
pub(super) struct Attributes<'a>(pub &'a BytesStart<'a>);

impl<'a> Attributes<'a> {
    fn raw(&self, name: &str) -> Option<std::borrow::Cow<'a, [u8]>> {
        let mut all = self.0.attributes();
        let mut all = all.with_checks(false).flatten();
        all.find(|attribute| attribute.key.local_name().as_ref() == name.as_bytes()).map(|a| a.value)
    }

    pub(super) fn text(&self, name: &str) -> Option<String> {
        attributes(self.0).find(|(key, _)| key == name.as_bytes()).map(|(_, value)| value)
    }

    fn number(&self, name: &str) -> Option<f64> {
        parse_number(self.raw(name)?.trim_ascii())
    }

    pub(super) fn index(&self, name: &str) -> Option<u32> {
        std::str::from_utf8(self.raw(name)?.trim_ascii()).ok()?.parse().ok()
    }
}

/// `#RRGGBB` or `#RRGGBBAA`.
pub(super) fn colour(text: &str) -> Option<[u8; 4]> {
    let digits = text.trim().strip_prefix('#')?;
    let number = u32::from_str_radix(digits, 16).ok()?;
    match digits.len() {
        6 => Some((number << 8 | 0xff).to_be_bytes()),
        8 => Some(number.to_be_bytes()),
        _ => None,
    }
}

/// The filament of a triangle that is painted as a whole, 0 for none: hexadecimal digits from the last on, of which the
/// low two bits are the number of its sides that are divided, the others the filament, 3 or more in the next digit
/// (PrusaSlicer, `TriangleSelector::serialize`).
fn painted(text: &[u8]) -> Option<u32> {
    let mut digits = text.iter().rev().map(|&byte| char::from(byte).to_digit(16));
    let filament = match digits.next()?? {
        12 => 3 + digits.next()?.filter(|&digit| digit < 15)?,
        digit => Some(digit >> 2).filter(|_| digit & 3 == 0)?,
    };
    digits.next().is_none().then_some(filament)
}

/// Transform of twelve numbers: four rows of three, applied to row vectors (Core Specification, section 3.3).
fn transform(text: &str) -> Option<DMat4> {
    let numbers: Option<Vec<f64>> =
        text.split_ascii_whitespace().map(|word| parse_number(word.as_bytes())).collect();
    let numbers = numbers.filter(|numbers| numbers.len() == 12 && numbers.iter().all(|n| n.is_finite()))?;
    let column = |row: usize, w: f64| DVec3::from_slice(&numbers[3 * row..]).extend(w);
    let columns: [DVec4; 4] = [column(0, 0.0), column(1, 0.0), column(2, 0.0), column(3, 1.0)];
    Some(DMat4::from_cols(columns[0], columns[1], columns[2], columns[3]))
}

/// Millimetres per unit of length.
fn unit(name: &str) -> Option<f64> {
    Some(match name {
        "micron" => 1e-3,
        "millimeter" => 1.0,
        "centimeter" => 10.0,
        "inch" => 25.4,
        "foot" => 304.8,
        "meter" => 1000.0,
        _ => return None,
    })
}

fn wrap(style: Option<&str>) -> Wrap {
    match style {
        Some("mirror") => Wrap::MirroredRepeat,
        Some("clamp" | "none") => Wrap::ClampToEdge,
        _ => Wrap::Repeat,
    }
}

/// Object under construction, with its default property.
struct ObjectBuilder {
    id: u32,
    group: Option<u32>,
    index: u32,
    object: Definition,
}

/// Bytes of an entry of a hash map by id, half of whose slots are free.
const fn hash_entry<T>() -> usize {
    2 * size_of::<(u32, T)>()
}

struct Parser<'a> {
    package: &'a Package<'a>,
    part: &'a str,
    source: &'a Source,
    model: Model,
    open: Option<ObjectBuilder>,
    /// Current property group.
    group: Option<u32>,
    /// Current metadata: name, and value so far.
    metadata: Option<(String, String)>,
    /// Numbers of triangles, and of items and components.
    triangles: u64,
    references: u64,
    /// Bytes of the model so far, and the number at which they are checked next.
    bytes: u64,
    next_check: u64,
}

/// Bytes of a model at the first check of the memory limit.
const FIRST_CHECK: u64 = 8 << 20;

impl Model {
    /// Reads the model in a part of the package; `None` if there is no such part.
    pub(super) fn read(package: &Package, part: &str, source: &Source) -> Result<Option<Self>> {
        let Some((stream, _)) = package.stream(part)? else { return Ok(None) };
        let model = Model { unit: 1.0, ..Model::default() };
        let mut parser = Parser {
            package,
            part,
            source,
            model,
            open: None,
            group: None,
            metadata: None,
            triangles: 0,
            references: 0,
            bytes: 0,
            next_check: FIRST_CHECK,
        };
        let mut reader = quick_xml::Reader::from_reader(stream);
        let mut buffer = Vec::new();
        let mut is_whole = false;
        loop {
            buffer.clear();
            match reader.read_event_into(&mut buffer).map_err(|e| package.broken(part, e))? {
                Event::Eof => break,
                Event::Start(e) => parser.start(&e)?,
                Event::Empty(e) => {
                    parser.start(&e)?;
                    parser.end(e.local_name().as_ref());
                }
                Event::End(e) => {
                    is_whole |= e.local_name().as_ref() == b"model";
                    parser.end(e.local_name().as_ref());
                }
                Event::Text(text) => parser.add_text(&String::from_utf8_lossy(&text))?,
                Event::GeneralRef(name) => {
                    let name = String::from_utf8_lossy(&name).into_owned();
                    parser.add_text(resolve_predefined_entity(&name).unwrap_or_default())?;
                }
                _ => {}
            }
        }
        if !is_whole {
            return Err(package.broken(part, "the XML ends within the model"));
        }
        Ok(Some(parser.model))
    }
}

impl Parser<'_> {
    /// Appends to the current metadata value.
    fn add_text(&mut self, text: &str) -> Result<()> {
        if self.metadata.is_none() {
            return Ok(());
        }
        self.keep(text.len())?;
        if let Some((_, value)) = &mut self.metadata {
            value.push_str(text);
        }
        Ok(())
    }

    /// Counts bytes that are added to the model. Checks the memory limit each time they have doubled.
    fn keep(&mut self, bytes: usize) -> Result<()> {
        self.bytes += bytes as u64;
        if self.bytes < self.next_check {
            return Ok(());
        }
        self.next_check = 2 * self.bytes;
        // As many bytes again, while a list is copied into one of twice its size.
        limits::check_claim(3 * self.bytes).map_err(|excess| {
            let what = format!("more than {} of elements: reading more", Bytes(self.bytes));
            excess.at(Place::item(&self.source.file, self.part), what)
        })
    }

    fn check_count(&self, counted: Counted, count: u64) -> Result<()> {
        counted.check(count, &self.source.options.limits, self.source.file.as_path())
    }

    fn fault(&self, what: impl std::fmt::Display) -> Error {
        let place = match &self.open {
            Some(open) => format!("{}, object {}", self.part, open.id),
            None => self.part.to_owned(),
        };
        self.package.broken(&place, what)
    }

    fn start(&mut self, e: &BytesStart) -> Result<()> {
        let attributes = Attributes(e);
        match e.local_name().as_ref() {
            b"vertex" | b"triangle" => self.mesh_element(e)?,
            b"model" => {
                if let Some(name) = attributes.text("unit") {
                    let unknown = || self.fault("unknown unit");
                    self.model.unit = unit(&name).ok_or_else(unknown)?;
                }
            }
            b"metadata" => {
                // Of objects, those of Cura have a role.
                let is_used = |name: &String| self.open.is_none() || role(name).is_some();
                self.metadata = attributes.text("name").filter(is_used).map(|name| (name, String::new()));
                self.keep(size_of::<[String; 2]>())?;
            }
            b"object" => {
                let id = attributes.index("id").ok_or_else(|| self.fault("an object without an id"))?;
                let of = |name: &str| attributes.text(name).unwrap_or_default();
                let (kind, subtype) = (of("type"), of("subtype"));
                let mut others = ["support", "solidsupport", "other"].into_iter();
                let other_type = others.find(|other| *other == kind).or_else(|| role(&subtype));
                let name = attributes.text("name").filter(|name| !name.is_empty());
                self.keep(hash_entry::<Definition>() + name.as_ref().map_or(0, String::len))?;
                let object = Definition { name, other_type, ..Definition::default() };
                let (group, index) = (attributes.index("pid"), attributes.index("pindex").unwrap_or(0));
                self.open = Some(ObjectBuilder { id, group, index, object });
            }
            b"component" => {
                let reference = self.reference(&attributes)?;
                if let Some(open) = &mut self.open {
                    open.object.components.push(reference);
                }
            }
            b"item" => {
                let reference = self.reference(&attributes)?;
                self.model.items.push(reference);
            }
            _ => self.property_element(e)?,
        }
        Ok(())
    }

    /// Vertices and triangles.
    fn mesh_element(&mut self, e: &BytesStart) -> Result<()> {
        let attributes = Attributes(e);
        let Some(open) = &mut self.open else { return Ok(()) };
        if e.local_name().as_ref() == b"vertex" {
            let (Some(x), Some(y), Some(z)) =
                (attributes.number("x"), attributes.number("y"), attributes.number("z"))
            else {
                let what = format!("vertex {} without three numbers", open.object.positions.len());
                return Err(self.fault(what));
            };
            open.object.positions.push(DVec3::new(x, y, z));
            return self.keep(size_of::<DVec3>());
        }
        let index = open.object.triangles.len();
        let (Some(a), Some(b), Some(c)) =
            (attributes.index("v1"), attributes.index("v2"), attributes.index("v3"))
        else {
            return Err(self.fault(format!("triangle {index} without three vertices")));
        };
        let count = open.object.positions.len();
        if [a, b, c].iter().any(|&corner| corner as usize >= count) {
            let what = format!("triangle {index} has a vertex index beyond {count} vertices");
            return Err(self.fault(what));
        }
        open.object.triangles.push([a, b, c]);
        let first = attributes.index("p1");
        let group = attributes.index("pid").or(open.group);
        let corner = |name: &str| attributes.index(name).or(first).unwrap_or(open.index);
        let corners = [corner("p1"), corner("p2"), corner("p3")];
        let mut property = group.map(|group| (group, corners));
        let mut all = e.attributes();
        let paint = all.with_checks(false).flatten().find(|attribute| {
            [&b"paint_color"[..], b"mmu_segmentation"].contains(&attribute.key.local_name().as_ref())
        });
        match paint.map(|paint| painted(paint.value.trim_ascii())) {
            None | Some(Some(0)) => {}
            Some(Some(filament)) => {
                self.model.is_painted = true;
                property = Some((FILAMENT, [filament; 3]));
            }
            Some(None) => drop(self.model.left_out.insert("colours painted on parts of triangles")),
        }
        open.object.properties.push(property);
        self.triangles += 1;
        self.check_count(Counted::Triangles, self.triangles)?;
        self.keep(size_of::<[u32; 3]>() + size_of::<Option<(u32, [u32; 3])>>())
    }

    fn reference(&mut self, attributes: &Attributes) -> Result<Reference> {
        self.references += 1;
        self.check_count(Counted::Nodes, self.references)?;
        let object =
            attributes.index("objectid").ok_or_else(|| self.fault("an item without the id of an object"))?;
        let transform = match attributes.text("transform") {
            Some(text) => transform(&text)
                .ok_or_else(|| self.fault(format!("the transform of object {object} is not 12 numbers")))?,
            None => DMat4::IDENTITY,
        };
        let path = attributes.text("path");
        self.keep(size_of::<Reference>() + path.as_ref().map_or(0, String::len))?;
        let is_printable = attributes.text("printable").as_deref() != Some("0");
        Ok(Reference { object, path, transform, is_printable })
    }

    /// Starts a property group.
    fn add_group(&mut self, id: Option<u32>, group: Property) -> Result<()> {
        self.group = id;
        self.keep(hash_entry::<Property>())?;
        id.map(|id| self.model.properties.insert(id, group));
        Ok(())
    }

    /// Materials, colours and textures.
    fn property_element(&mut self, e: &BytesStart) -> Result<()> {
        let attributes = Attributes(e);
        let id = attributes.index("id");
        match e.local_name().as_ref() {
            b"basematerials" | b"colorgroup" => {
                self.add_group(id, Property::Colours(Vec::new()))?;
            }
            b"base" | b"color" => {
                let text = attributes.text("displaycolor").or_else(|| attributes.text("color"));
                let value = text.as_deref().and_then(colour);
                if let Some(Property::Colours(colours)) =
                    self.group.and_then(|group| self.model.properties.get_mut(&group))
                {
                    // `displaycolor` is optional: default grey.
                    colours.push(value.unwrap_or([204, 204, 204, 255]));
                    self.keep(size_of::<[u8; 4]>())?;
                }
            }
            b"texture2dgroup" => {
                let texture = attributes.index("texid").unwrap_or(u32::MAX);
                self.add_group(id, Property::Coordinates { texture, uvs: Vec::new() })?;
            }
            b"tex2coord" => {
                let uv = DVec2::new(
                    attributes.number("u").unwrap_or(0.0),
                    1.0 - attributes.number("v").unwrap_or(0.0),
                );
                if let Some(Property::Coordinates { uvs, .. }) =
                    self.group.and_then(|group| self.model.properties.get_mut(&group))
                {
                    uvs.push(uv);
                    self.keep(size_of::<DVec2>())?;
                }
            }
            b"texture2d" => {
                if let (Some(id), Some(path)) = (id, attributes.text("path")) {
                    let wrap = [
                        wrap(attributes.text("tilestyleu").as_deref()),
                        wrap(attributes.text("tilestylev").as_deref()),
                    ];
                    self.keep(hash_entry::<TextureFile>() + path.len())?;
                    self.model.textures.insert(id, TextureFile { path, wrap });
                }
            }
            b"compositematerials" => drop(self.model.left_out.insert("composite materials")),
            b"multiproperties" => drop(self.model.left_out.insert("several properties of a triangle")),
            b"beamlattice" => drop(self.model.left_out.insert("beam lattices")),
            b"slicestack" => drop(self.model.left_out.insert("slices")),
            _ => {}
        }
        Ok(())
    }

    fn end(&mut self, name: &[u8]) {
        match name {
            b"metadata" => match (self.metadata.take(), &mut self.open) {
                (Some((name, value)), Some(open)) if value == "True" => open.object.other_type = role(&name),
                (metadata, None) => self.model.metadata.extend(metadata),
                _ => {}
            },
            b"basematerials" | b"colorgroup" | b"texture2dgroup" => self.group = None,
            b"object" => {
                let opened = self.open.take();
                self.model.objects.extend(opened.map(|open| (open.id, open.object)));
            }
            _ => {}
        }
    }
}
