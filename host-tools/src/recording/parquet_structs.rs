//! The structs of a Parquet file that are read here, by their fields (Apache Parquet, parquet.thrift).

use crate::recording::thrift::Fields;
use crate::recording::thrift::Kind::{self, Boolean, Byte, Bytes, Double, List, Struct, Whole};

/// What stands before each page (PageHeader).
pub(super) const PAGE: Fields = &[
    (TYPE, Whole),
    (SIZE, Whole),
    (COMPRESSED_SIZE, Whole),
    (4, Whole),
    // Data, index, dictionary, data in the second form.
    (
        5,
        Struct(&[(1, Whole), (2, Whole), (3, Whole), (4, Whole), (5, STATISTICS)]),
    ),
    (6, EMPTY),
    (DICTIONARY, Struct(&[(COUNT, Whole), (2, Whole), (3, Boolean)])),
    (
        8,
        Struct(&[
            (1, Whole),
            (2, Whole),
            (3, Whole),
            (4, Whole),
            (5, Whole),
            (6, Whole),
            (7, Boolean),
            (8, STATISTICS),
        ]),
    ),
];

const TYPE: i64 = 1;
/// How the values of a page are written, in its two forms.
pub(super) const ENCODINGS: [[i64; 2]; 2] = [[5, 2], [8, 4]];
/// Lengths of texts as differences, and what texts have in common with those before.
pub(super) const DELTA_LENGTH_BYTE_ARRAY: i32 = 6;
pub(super) const DELTA_BYTE_ARRAY: i32 = 7;
/// What a page of a dictionary tells besides, and the field in it of how many values it has.
pub(super) const DICTIONARY: i64 = 7;
pub(super) const COUNT: i64 = 1;
/// Field of a page's size, bytes.
pub(super) const SIZE: i64 = 2;
/// Field of its size in the file, bytes.
pub(super) const COMPRESSED_SIZE: i64 = 3;

/// What stands at the end of a file (FileMetaData). Keys of encryption are read by nobody here.
pub(super) const FILE: Fields = &[
    (1, Whole),
    (SCHEMA, List(&SCHEMA_ELEMENT)),
    (3, Whole),
    (4, List(&ROW_GROUP)),
    (5, List(&KEY_VALUE)),
    (6, Bytes),
    // How a column is ordered: one of several empty structs.
    (7, List(&Struct(&[(1, EMPTY), (2, EMPTY)]))),
    (9, Bytes),
];

/// Field of the columns and their groups: each group stands before what lies in it.
pub(super) const SCHEMA: i64 = 2;
/// Field of the name of one of them.
pub(super) const NAME: i64 = 4;
/// Field of how many columns and groups lie in one of them.
pub(super) const CHILDREN: i64 = 5;

const EMPTY: Kind = Struct(&[]);

const STATISTICS: Kind = Struct(&[
    (1, Bytes),
    (2, Bytes),
    (3, Whole),
    (4, Whole),
    (5, Bytes),
    (6, Bytes),
    (7, Boolean),
    (8, Boolean),
    (9, Whole),
]);

const KEY_VALUE: Kind = Struct(&[(1, Bytes), (2, Bytes)]);

const SCHEMA_ELEMENT: Kind = Struct(&[
    (1, Whole),
    (2, Whole),
    (3, Whole),
    (NAME, Bytes),
    (CHILDREN, Whole),
    (6, Whole),
    (7, Whole),
    (8, Whole),
    (9, Whole),
    (10, LOGICAL_TYPE),
]);

const LOGICAL_TYPE: Kind = Struct(&[
    (1, EMPTY),
    (2, EMPTY),
    (3, EMPTY),
    (4, EMPTY),
    // Decimal.
    (5, Struct(&[(1, Whole), (2, Whole)])),
    (6, EMPTY),
    // Time and timestamp, and whole numbers.
    (7, TIME),
    (8, TIME),
    (10, Struct(&[(1, Byte), (2, Boolean)])),
    (11, EMPTY),
    (12, EMPTY),
    (13, EMPTY),
    (14, EMPTY),
    (15, EMPTY),
    // Variant, geometry, geography, file.
    (16, Struct(&[(1, Byte)])),
    (17, Struct(&[(1, Bytes)])),
    (18, Struct(&[(1, Bytes), (2, Whole)])),
    (19, EMPTY),
]);

/// Whether it is in UTC, and its unit.
const TIME: Kind = Struct(&[(1, Boolean), (2, Struct(&[(1, EMPTY), (2, EMPTY), (3, EMPTY)]))]);

const ROW_GROUP: Kind = Struct(&[
    (1, List(&COLUMN_CHUNK)),
    (2, Whole),
    (3, Whole),
    // What it is sorted by.
    (4, List(&Struct(&[(1, Whole), (2, Boolean), (3, Boolean)]))),
    (5, Whole),
    (6, Whole),
    (7, Whole),
]);

const COLUMN_CHUNK: Kind = Struct(&[
    (1, Bytes),
    (2, Whole),
    (3, COLUMN),
    (4, Whole),
    (5, Whole),
    (6, Whole),
    (7, Whole),
    (9, Bytes),
]);

const COLUMN: Kind = Struct(&[
    (1, Whole),
    (2, List(&Whole)),
    (3, List(&Bytes)),
    (4, Whole),
    (5, Whole),
    (6, Whole),
    (7, Whole),
    (8, List(&KEY_VALUE)),
    (9, Whole),
    (10, Whole),
    (11, Whole),
    (12, STATISTICS),
    // How many pages have each encoding.
    (13, List(&Struct(&[(1, Whole), (2, Whole), (3, Whole)]))),
    (14, Whole),
    (15, Whole),
    // Sizes, and bounds of places on the earth.
    (16, Struct(&[(1, Whole), (2, List(&Whole)), (3, List(&Whole))])),
    (17, Struct(&[(1, Struct(BOX)), (2, List(&Whole))])),
]);

const BOX: Fields = &[
    (1, Double),
    (2, Double),
    (3, Double),
    (4, Double),
    (5, Double),
    (6, Double),
    (7, Double),
    (8, Double),
];
