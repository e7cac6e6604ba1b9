//! Types of arrays in VTK files.

use crate::scanner::Scalar;

/// The type of an array.
#[derive(Clone, Copy, Debug, Eq, PartialEq)]
pub(super) enum DataType {
    Number(Scalar),
    /// Eight values in a byte.
    Bit,
    /// Text with its length before it.
    Text,
}

impl DataType {
    pub fn parse(name: &str) -> Option<Self> {
        Some(Self::Number(match name.to_ascii_lowercase().as_str() {
            "char" | "signed_char" | "vtktypeint8" => Scalar::I8,
            "unsigned_char" | "vtktypeuint8" => Scalar::U8,
            "short" | "vtktypeint16" => Scalar::I16,
            "unsigned_short" | "vtktypeuint16" => Scalar::U16,
            // VTK writes its identifiers with four bytes.
            "int" | "vtkidtype" | "vtktypeint32" => Scalar::I32,
            "unsigned_int" | "vtktypeuint32" => Scalar::U32,
            "long" | "long_long" | "vtktypeint64" => Scalar::I64,
            "unsigned_long" | "unsigned_long_long" | "vtktypeuint64" => Scalar::U64,
            "float" | "vtktypefloat32" => Scalar::F32,
            "double" | "vtktypefloat64" => Scalar::F64,
            "bit" => return Some(Self::Bit),
            "string" | "utf8_string" => return Some(Self::Text),
            _ => return None,
        }))
    }
}
