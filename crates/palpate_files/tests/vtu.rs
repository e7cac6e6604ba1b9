//! VTU files.

use crate::grid::{self, Grid, assert_cube, assert_mixed};
use base64::Engine;
use base64::engine::general_purpose::STANDARD;
use palpate_files::{MeshFileError, TetrahedralFile, TetrahedralFormat};

fn read(bytes: &[u8]) -> Result<TetrahedralFile, MeshFileError> {
    TetrahedralFile::from_bytes(bytes, TetrahedralFormat::Vtu, None)
}

/// Where the numbers of arrays are.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum Storage {
    Text,
    /// Inline, the header and the content in one piece of base64.
    Joined,
    /// Inline, the header and the content encoded separately.
    Separate,
    Raw,
    Base64,
}

#[derive(Clone, Copy, Debug)]
pub struct Form {
    pub storage: Storage,
    /// Attribute `compressor`, or empty.
    pub compressor: &'static str,
    pub is_big: bool,
    pub header_bytes: usize,
}

const ZLIB: &str = "vtkZLibDataCompressor";
const LZ4: &str = "vtkLZ4DataCompressor";

pub fn forms() -> Vec<Form> {
    let mut forms = Vec::new();
    for storage in [Storage::Text, Storage::Joined, Storage::Separate, Storage::Raw, Storage::Base64] {
        for compressor in ["", ZLIB, LZ4] {
            for (is_big, header_bytes) in [(false, 4), (false, 8), (true, 4), (true, 8)] {
                forms.push(Form { storage, compressor, is_big, header_bytes });
            }
        }
    }
    forms
}

struct Writer {
    form: Form,
    appended: Vec<u8>,
}

impl Writer {
    fn ordered(&self, little: &[u8]) -> Vec<u8> {
        let mut bytes = little.to_vec();
        if self.form.is_big {
            bytes.reverse();
        }
        bytes
    }

    fn size(&self, value: usize) -> Vec<u8> {
        self.ordered(&(value as u64).to_le_bytes()[..self.form.header_bytes])
    }

    /// The header and the content of an array.
    fn encode(&self, content: &[u8]) -> [Vec<u8>; 2] {
        if self.form.compressor.is_empty() {
            return [self.size(content.len()), content.to_vec()];
        }
        // Blocks that end within a number.
        let block_size = 100;
        let compressed: Vec<Vec<u8>> = content
            .chunks(block_size)
            .map(|block| match self.form.compressor {
                LZ4 => lz4_flex::block::compress(block),
                _ => miniz_oxide::deflate::compress_to_vec_zlib(block, 6),
            })
            .collect();
        let sizes = [compressed.len(), block_size, content.len() % block_size];
        let sizes = sizes.into_iter().chain(compressed.iter().map(Vec::len));
        [sizes.flat_map(|size| self.size(size)).collect(), compressed.concat()]
    }

    fn array(&mut self, name: &str, kind: &str, components: usize, values: &[f64]) -> String {
        let attributes = format!("type=\"{kind}\" Name=\"{name}\" NumberOfComponents=\"{components}\"");
        if self.form.storage == Storage::Text {
            let text: Vec<String> = values.iter().map(ToString::to_string).collect();
            return format!("<DataArray {attributes} format=\"ascii\">\n{}\n</DataArray>\n", text.join(" "));
        }
        let number = |value: f64| match kind {
            "Float64" => self.ordered(&value.to_le_bytes()),
            "Float32" => self.ordered(&(value as f32).to_le_bytes()),
            "Int64" => self.ordered(&(value as i64).to_le_bytes()),
            "Int32" => self.ordered(&(value as i32).to_le_bytes()),
            "UInt8" => vec![value as u8],
            _ => panic!("{kind}"),
        };
        let content: Vec<u8> = values.iter().flat_map(|value| number(*value)).collect();
        let [header, content] = self.encode(&content);
        let joined = STANDARD.encode([header.clone(), content.clone()].concat());
        let separate = format!("{}{}", STANDARD.encode(&header), STANDARD.encode(&content));
        let text = match self.form.storage {
            Storage::Joined => joined,
            Storage::Separate => separate,
            Storage::Raw | Storage::Base64 => {
                let offset = self.appended.len();
                if self.form.storage == Storage::Raw {
                    self.appended.extend([header, content].concat());
                } else {
                    self.appended.extend(separate.as_bytes());
                }
                return format!("<DataArray {attributes} format=\"appended\" offset=\"{offset}\"/>\n");
            }
            Storage::Text => unreachable!(),
        };
        format!("<DataArray {attributes} format=\"binary\">\n  {text}\n</DataArray>\n")
    }

    fn piece(&mut self, grid: &Grid) -> String {
        let positions: Vec<f64> = grid.nodes.iter().flat_map(|(_, position)| *position).collect();
        let nodes: Vec<f64> =
            grid.elements.iter().flat_map(|e| e.vtk_nodes()).map(|node| node as f64).collect();
        let ends: Vec<f64> = grid
            .elements
            .iter()
            .scan(0, |end, element| {
                *end += element.nodes.len();
                Some(*end as f64)
            })
            .collect();
        let types: Vec<f64> = grid.elements.iter().map(|element| f64::from(element.kind.vtk())).collect();
        let groups: Vec<f64> = grid.elements.iter().map(|element| f64::from(element.group)).collect();
        let halves: Vec<f64> = groups.iter().map(|group| group + 0.5).collect();
        let (node_count, cell_count) = (grid.nodes.len(), grid.elements.len());
        [
            format!("<Piece NumberOfPoints=\"{node_count}\" NumberOfCells=\"{cell_count}\">\n<CellData>\n"),
            self.array("gmsh:physical", "Float32", 1, &halves),
            self.array("MaterialIds", "Int32", 1, &groups),
            self.array("label", "Float64", 1, &halves),
            "</CellData>\n<Points>\n".into(),
            self.array("Points", "Float64", 3, &positions),
            "</Points>\n<Cells>\n".into(),
            self.array("connectivity", "Int64", 1, &nodes),
            self.array("offsets", "Int32", 1, &ends),
            self.array("types", "UInt8", 1, &types),
            "</Cells>\n</Piece>\n".into(),
        ]
        .concat()
    }
}

pub fn file(grids: &[Grid], form: Form) -> Vec<u8> {
    let mut writer = Writer { form, appended: Vec::new() };
    let order = if form.is_big { "BigEndian" } else { "LittleEndian" };
    let header = if form.header_bytes == 8 { "UInt64" } else { "UInt32" };
    let compressor = match form.compressor {
        "" => String::new(),
        name => format!(" compressor=\"{name}\""),
    };
    let mut bytes = format!(
        "<?xml version=\"1.0\"?>\n<VTKFile type=\"UnstructuredGrid\" version=\"1.0\" byte_order=\"{order}\" header_type=\"{header}\"\
         {compressor}>\n<UnstructuredGrid>\n<Piece NumberOfPoints=\"0\" NumberOfCells=\"0\"/>\n"
    )
    .into_bytes();
    grids.iter().for_each(|grid| bytes.extend(writer.piece(grid).as_bytes()));
    bytes.extend(b"</UnstructuredGrid>\n");
    if !writer.appended.is_empty() {
        let encoding = if form.storage == Storage::Raw { "raw" } else { "base64" };
        bytes.extend(format!("<AppendedData encoding=\"{encoding}\">\n  _").as_bytes());
        bytes.extend(&writer.appended);
        bytes.extend(b"\n</AppendedData>\n");
    }
    bytes.extend(b"</VTKFile>\n");
    bytes
}

#[test]
fn reads_cube_in_each_form() {
    for form in forms() {
        let cube = read(&file(&[grid::cube()], form)).unwrap_or_else(|error| panic!("{form:?}: {error}"));
        assert_cube(&cube, 7, 2);
        let counts = cube.counts;
        assert_eq!([counts.points, counts.lines, counts.faces, counts.unused_nodes], [1; 4]);
    }
}

#[test]
fn reads_several_pieces_of_mixed_elements() {
    for form in forms() {
        let bytes = file(&[grid::mixed(5), grid::cube().quadratic()], form);
        let file = read(&bytes).unwrap();
        assert_eq!((file.tetrahedra.len(), file.vertices.len()), (24 + 6, 17 + 8));
        assert_eq!(grid::six_fold_volumes(&file).iter().sum::<f64>(), 24.0);
        let numbers: Vec<i64> = file.region_list.iter().map(|region| region.number).collect();
        assert_eq!(numbers, [1, 2, 3, 7]);
        assert_mixed(&read(&self::file(&[grid::mixed(6)], form)).unwrap());
    }
}

const TEXT: Form = Form { storage: Storage::Text, compressor: "", is_big: false, header_bytes: 4 };

#[test]
fn rejects_broken_files_with_the_reason() {
    let text = String::from_utf8(file(&[grid::cube()], TEXT)).unwrap();
    let raw = |from: &str, to: &str| {
        let bytes = file(&[grid::cube()], Form { storage: Storage::Base64, compressor: ZLIB, ..TEXT });
        String::from_utf8(bytes).unwrap().replace(from, to)
    };
    let cases = [
        (text.replace("</Cells>", ""), "its XML is wrong"),
        (text.replace("VTKFile", "VTK"), "its root must be <VTKFile>"),
        (text.replace("LittleEndian", "Little"), "an attribute byte_order is `Little`"),
        (text.replace("UInt32", "UInt16"), "an attribute header_type is `UInt16`"),
        (text.replace("\"Int64\"", "\"Int\""), "an attribute type is `Int`"),
        (
            text.replace("NumberOfCells=\"9\"", "NumberOfCells=\"-9\""),
            "must have a whole number NumberOfCells",
        ),
        (text.replace("NumberOfCells=\"9\"", "NumberOfCells=\"8\""), "array offsets must have 8 numbers"),
        (text.replace("NumberOfCells=\"9\"", "NumberOfCells=\"10\""), "array offsets: it ends before"),
        (text.replace("Name=\"types\"", "Name=\"kinds\""), "must have an array types in <Cells>"),
        (
            text.replace("<Points>", "<Dots>").replace("</Points>", "</Dots>"),
            "must have an array in <Points>",
        ),
        (text.replace("\n4 8 12 ", "\n4 3 12 "), "an offset of a cell is 3; it must be at least 4"),
        (text.replace("\n10 10 ", "\n10 10.5 "), "array types: line 2: a value is 10.5"),
        (text.replace("format=\"ascii\"", "format=\"text\""), "an attribute format is `text`"),
        (raw("offset=\"0\"", "offset=\"\"").replace("label", "label "), "the root is fine"),
        (
            raw(
                "Name=\"Points\" NumberOfComponents=\"3\" format=\"appended\" offset=\"",
                "Name=\"Points\" NumberOfComponents=\"3\" format=\"appended\" offset=\"99999",
            ),
            "offset of array Points is 99999",
        ),
        (
            raw("<AppendedData", "<Appended").replace("</AppendedData", "</Appended"),
            "it must have an offset into <AppendedData>",
        ),
        (raw(">\n  _", ">\n  _!"), "data in base64 are broken"),
        (raw(">\n  _AQ", ">\n  _AA"), "the root is fine"),
    ];
    for (broken, expected) in cases {
        if expected == "the root is fine" {
            // An array of regions that cannot be read is none.
            assert_eq!(read(broken.as_bytes()).unwrap().tetrahedra.len(), 6);
            continue;
        }
        let error = read(broken.as_bytes()).unwrap_err();
        assert!(matches!(error, MeshFileError::VolumeNotValid { format: "VTU", .. }), "{expected}: {error}");
        assert!(error.to_string().contains(expected), "{expected}: {error}");
    }
}

#[test]
fn rejects_other_data_compressors_and_counts() {
    let text = String::from_utf8(file(&[grid::cube()], TEXT)).unwrap();
    let error = read(text.replace("\"UnstructuredGrid\"", "\"PolyData\"").as_bytes()).unwrap_err();
    assert!(
        matches!(&error, MeshFileError::OtherDataSet { content, .. } if content == "PolyData"),
        "{error}"
    );
    // Arrays in text are not compressed.
    let lzma = |storage| file(&[grid::cube()], Form { storage, compressor: "vtkLZMADataCompressor", ..TEXT });
    assert_cube(&read(&lzma(Storage::Text)).unwrap(), 7, 2);
    let error = read(&lzma(Storage::Raw)).unwrap_err();
    let is_named = matches!(&error, MeshFileError::CompressorNotRead { compressor } if compressor == "vtkLZMADataCompressor");
    assert!(is_named, "{error}");
    for count in ["20000001", "18446744073709551615"] {
        let many = text.replace("NumberOfCells=\"9\"", &format!("NumberOfCells=\"{count}\""));
        assert!(matches!(read(many.as_bytes()).unwrap_err(), MeshFileError::TooLarge { .. }));
    }
    let mut surface = grid::cube();
    surface.elements.drain(..6);
    let error = read(&file(&[surface], TEXT)).unwrap_err();
    assert!(matches!(&error, MeshFileError::NoTetrahedra { format: "VTU", .. }), "{error}");
    let error = read(&file(&[], TEXT)).unwrap_err();
    assert!(
        matches!(&error, MeshFileError::NoTetrahedra { content, .. } if content == "no elements"),
        "{error}"
    );
}

#[test]
fn deep_and_wide_xml_is_rejected() {
    for text in ["<VTKFile>".repeat(300_000), format!("<VTKFile>{}</VTKFile>", "<a/>".repeat(1_100_000))] {
        let error = read(text.as_bytes()).unwrap_err();
        assert!(matches!(error, MeshFileError::VolumeNotValid { .. }), "{error}");
    }
}

#[test]
fn rejects_compressed_blocks_that_expand_beyond_their_size() {
    // A block of a megabyte of zeros states ten bytes.
    let bomb = miniz_oxide::deflate::compress_to_vec_zlib(&vec![0; 1 << 20], 6);
    let array = |block_size: u32| {
        let header = [1, block_size, 0, bomb.len() as u32];
        let header: Vec<u8> = header.iter().flat_map(|size| size.to_le_bytes()).collect();
        let text = format!("{}{}", STANDARD.encode(header), STANDARD.encode(&bomb));
        format!(
            "<VTKFile type=\"UnstructuredGrid\" compressor=\"{ZLIB}\"><UnstructuredGrid><Piece NumberOfPoints=\"2\" NumberOfCells=\"1\">\
             <Points><DataArray type=\"Float64\" format=\"binary\">{text}</DataArray></Points></Piece></UnstructuredGrid></VTKFile>"
        )
    };
    let error = read(array(48).as_bytes()).unwrap_err();
    assert!(error.to_string().contains("a block of compressed data is broken"), "{error}");
    let error = read(array(1 << 20).as_bytes()).unwrap_err();
    assert!(error.to_string().contains("array Points must have 6 numbers"), "{error}");
}
