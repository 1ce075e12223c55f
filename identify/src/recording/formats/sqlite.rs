//! Reads tables of a SQLite database, row by row.
//!
//! A database consists of pages of equal size. A table is a tree of pages with a row in each cell of a leaf. Bytes
//! that do not fit into a cell continue in a chain of overflow pages (sqlite.org/fileformat2.html, sections 1.3, 1.6
//! and 2.1). Indices, views and a write-ahead log are not read.
//!
//! Decision: an own reader, because only the rows of two tables are needed. It needs memory for one page only.

use std::io::{self, Read, Seek, SeekFrom};

use modelmill_boundary::nesting::NestingLevel;

/// Largest depth of a tree; a deeper one would exceed any disk.
const DEEPEST: usize = 24;
/// Longest row in bytes.
const LONGEST_ROW: u64 = 256 << 20;

/// First bytes of a database.
pub(super) const MAGIC: &[u8; 16] = b"SQLite format 3\0";

/// A value in a row.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum SqliteValue {
    /// No value.
    Null,
    /// An integer.
    Integer(i64),
    /// A float.
    Real(f64),
    /// A text in UTF-8.
    Text(String),
    /// Bytes without an encoding.
    Bytes(Vec<u8>),
}

impl SqliteValue {
    /// The integer, if it is one.
    pub(super) fn as_integer(&self) -> Option<i64> {
        match self {
            Self::Integer(value) => Some(*value),
            _ => None,
        }
    }

    /// The text; empty for other values.
    pub(super) fn as_text(&self) -> &str {
        match self {
            Self::Text(text) => text,
            _ => "",
        }
    }
}

/// An open database.
pub(super) struct SqliteDatabase<R> {
    /// The file.
    stream: R,
    /// Bytes of a page.
    page_size: usize,
    /// Bytes of a page without the reserved ones at its end.
    usable: usize,
    /// Number of pages of the file.
    pages: u64,
    /// Tables of the schema.
    tables: Vec<SqliteTable>,
}

/// A table of the schema.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SqliteTable {
    /// Its name.
    name: String,
    /// Number of the root page of its tree.
    root: u32,
    /// Names of its columns in order.
    columns: Vec<String>,
    /// Position of the column that is the number of the row; it is stored outside of the row.
    row_number: Option<usize>,
}

impl<R: Read + Seek> SqliteDatabase<R> {
    /// Opens a database and reads its schema. Fails when the header is not valid or the texts are not UTF-8.
    pub(super) fn open(mut stream: R) -> io::Result<Self> {
        let length = stream.seek(SeekFrom::End(0))?;
        stream.rewind()?;
        // The first 100 bytes are the header.
        let mut head = [0; 100];
        stream.read_exact(&mut head)?;
        // The value 1 means 65536, which does not fit into two bytes.
        let page_size = match u16::from_be_bytes([head[16], head[17]]) {
            1 => 1 << 16,
            size => usize::from(size),
        };
        let reserved = usize::from(head[20]);
        if !head.starts_with(MAGIC) || !page_size.is_power_of_two() || page_size < reserved + 480 {
            return Err(io::Error::other("its header is not valid"));
        }
        // Encoding 1 is UTF-8; 0 means that there is no text yet.
        if head[56..60] != [0, 0, 0, 1] && head[56..60] != [0; 4] {
            return Err(io::Error::other("its texts are not UTF-8"));
        }
        if !length.is_multiple_of(page_size as u64) {
            return Err(io::Error::other("it ends in the middle of a page"));
        }
        let mut database = Self {
            stream,
            page_size,
            usable: page_size - reserved,
            pages: length / page_size as u64,
            tables: Vec::new(),
        };
        // The schema is itself a table with its root on page 1.
        let schema = SqliteTable {
            name: String::new(),
            root: 1,
            columns: Vec::new(),
            row_number: None,
        };
        let mut tables = Vec::new();
        // Its rows have type, name, table, root page and the statement that created it.
        database.visit_all_rows(&schema, &mut |row| {
            if let [
                kind,
                SqliteValue::Text(name),
                _,
                SqliteValue::Integer(root),
                SqliteValue::Text(says),
                ..,
            ] = &row[..]
                && kind.as_text() == "table"
                && let Ok(root) = u32::try_from(*root)
            {
                let (columns, row_number) = columns_of(says);
                tables.push(SqliteTable {
                    name: name.clone(),
                    root,
                    columns,
                    row_number,
                });
            }
            Ok(())
        })?;
        database.tables = tables;
        Ok(database)
    }

    /// Passes the rows of a table to `show`, each with the values of `columns`; false if there is no such table.
    ///
    /// Fails when the table lacks a column, or when a page is not valid.
    pub(super) fn visit_rows(
        &mut self,
        table: &str,
        columns: &[&str],
        show: &mut dyn FnMut(Vec<SqliteValue>) -> io::Result<()>,
    ) -> io::Result<bool> {
        let Some(table) = self.tables.iter().find(|one| one.name == table).cloned() else {
            return Ok(false);
        };
        // Positions of the columns in a row.
        let places = columns.iter().map(|name| {
            let place = table.columns.iter().position(|other| other == name);
            place.ok_or_else(|| io::Error::other(format!("its table `{}` has no column `{name}`", table.name)))
        });
        let places = places.collect::<io::Result<Vec<usize>>>()?;
        // Values are moved out of the row, because each is used once.
        self.visit_all_rows(&table, &mut |mut row| {
            let values = places.iter().map(|place| match row.get_mut(*place) {
                Some(value) => std::mem::replace(value, SqliteValue::Null),
                None => SqliteValue::Null,
            });
            show(values.collect())
        })?;
        Ok(true)
    }

    /// Passes all rows of a table to `show`.
    fn visit_all_rows(
        &mut self,
        table: &SqliteTable,
        show: &mut dyn FnMut(Vec<SqliteValue>) -> io::Result<()>,
    ) -> io::Result<()> {
        // Every page may be visited once at most, so that cycles end.
        let mut left = self.pages;
        self.visit_tree(table, table.root, NestingLevel::top(DEEPEST), &mut left, show)
    }

    /// Passes the rows below a page to `show`, from left to right. `left` is the number of pages that may still be
    /// visited.
    fn visit_tree(
        &mut self,
        table: &SqliteTable,
        number: u32,
        level: NestingLevel,
        left: &mut u64,
        show: &mut dyn FnMut(Vec<SqliteValue>) -> io::Result<()>,
    ) -> io::Result<()> {
        let in_circles = || io::Error::other("its pages run in circles");
        if *left == 0 {
            return Err(in_circles());
        }
        *left -= 1;
        let page = self.read_page(number)?;
        // Page 1 starts with the header of the database.
        let start = if number == 1 { 100 } else { 0 };
        let kind = page[start];
        let cells = usize::from(read_u16(&page, start + 3)?);
        // The header of an inner page has four more bytes, for its last child.
        let pointers = match kind {
            LEAF => start + 8,
            BRANCH => start + 12,
            _ => return Err(io::Error::other("a page of it is not part of a table")),
        };
        // Pointers to the cells follow the header.
        for i in 0..cells {
            let at = usize::from(read_u16(&page, pointers + 2 * i)?);
            if kind == BRANCH {
                self.visit_tree(
                    table,
                    read_u32(&page, at)?,
                    level.enter().map_err(|_| in_circles())?,
                    left,
                    show,
                )?;
            } else {
                let (number, payload) = self.read_cell(&page, at, left)?;
                let mut row = read_record(&payload)?;
                // The column of the row number is stored as null.
                if let Some(place) = table.row_number
                    && row.get(place) == Some(&SqliteValue::Null)
                {
                    row[place] = SqliteValue::Integer(number);
                }
                show(row)?;
            }
        }
        // The last child of an inner page is in its header.
        if kind == BRANCH {
            self.visit_tree(
                table,
                read_u32(&page, start + 8)?,
                level.enter().map_err(|_| in_circles())?,
                left,
                show,
            )?;
        }
        Ok(())
    }

    /// The number of a row and its bytes, including those on overflow pages.
    fn read_cell(&mut self, page: &[u8], at: usize, left: &mut u64) -> io::Result<(i64, Vec<u8>)> {
        let mut cell = page.get(at..self.usable).ok_or_else(truncated_error)?;
        let length = read_varint(&mut cell)?.cast_unsigned();
        let number = read_varint(&mut cell)?;
        if length > LONGEST_ROW {
            return Err(io::Error::other("a row of it is longer than 256 MB"));
        }
        // The part of a row in its cell, by section 1.6 of the file format.
        let length = usize::try_from(length).map_err(io::Error::other)?;
        let most = self.usable - 35;
        let here = if length <= most {
            length
        } else {
            let least = (self.usable - 12) * 32 / 255 - 23;
            let here = least + (length - least) % (self.usable - 4);
            if here <= most { here } else { least }
        };
        let mut payload = cell.get(..here).ok_or_else(truncated_error)?.to_vec();
        // Each overflow page starts with the number of the next one.
        if here < length {
            let mut next = read_u32(cell, here)?;
            while payload.len() < length {
                if next == 0 || *left == 0 {
                    return Err(truncated_error());
                }
                *left -= 1;
                let page = self.read_page(next)?;
                next = read_u32(&page, 0)?;
                let n = (length - payload.len()).min(self.usable - 4);
                payload.extend_from_slice(&page[4..4 + n]);
            }
        }
        Ok((number, payload))
    }

    /// Reads a page; pages count from 1.
    fn read_page(&mut self, number: u32) -> io::Result<Vec<u8>> {
        if number == 0 || u64::from(number) > self.pages {
            return Err(truncated_error());
        }
        let start = u64::from(number - 1) * self.page_size as u64;
        self.stream.seek(SeekFrom::Start(start))?;
        let mut page = vec![0; self.page_size];
        self.stream.read_exact(&mut page)?;
        Ok(page)
    }
}

/// Kind of page: a leaf of a table.
const LEAF: u8 = 0x0d;
/// Kind of page: an inner page of a table.
const BRANCH: u8 = 0x05;

/// The error of a reference to bytes that do not exist.
fn truncated_error() -> io::Error {
    io::Error::other("it refers to bytes that it does not have")
}

/// Two bytes at a position as a number, the higher one first.
fn read_u16(bytes: &[u8], at: usize) -> io::Result<u16> {
    let found = bytes.get(at..at + 2).ok_or_else(truncated_error)?;
    Ok(u16::from_be_bytes([found[0], found[1]]))
}

/// Four bytes at a position as a number, the highest one first.
fn read_u32(bytes: &[u8], at: usize) -> io::Result<u32> {
    let found = bytes.get(at..at + 4).ok_or_else(truncated_error)?;
    Ok(u32::from_be_bytes([found[0], found[1], found[2], found[3]]))
}

/// Reads a number of one to nine bytes, the highest first. All bits of the ninth byte count.
fn read_varint(bytes: &mut &[u8]) -> io::Result<i64> {
    let mut value = 0_u64;
    for i in 0..9 {
        let (byte, rest) = bytes.split_first().ok_or_else(truncated_error)?;
        *bytes = rest;
        if i == 8 {
            return Ok((value << 8 | u64::from(*byte)).cast_signed());
        }
        value = value << 7 | u64::from(byte & 0x7f);
        if byte & 0x80 == 0 {
            break;
        }
    }
    Ok(value.cast_signed())
}

/// The values of a row. A header with their types comes first.
fn read_record(bytes: &[u8]) -> io::Result<Vec<SqliteValue>> {
    let mut rest = bytes;
    // The header starts with its own length.
    let length = usize::try_from(read_varint(&mut rest)?).map_err(|_| truncated_error())?;
    let mut values = bytes.get(length..).ok_or_else(truncated_error)?;
    let mut types = &bytes[bytes.len() - rest.len()..];
    types = types
        .get(..length.saturating_sub(bytes.len() - rest.len()))
        .ok_or_else(truncated_error)?;
    let mut row = Vec::new();
    // The type of a value gives its size.
    while !types.is_empty() {
        let kind = read_varint(&mut types)?;
        let size = match kind {
            0 | 8 | 9 => 0,
            1..=4 => kind,
            5 => 6,
            6 | 7 => 8,
            12.. => (kind - 12) / 2,
            _ => return Err(io::Error::other("a row of it has a value of no type")),
        };
        let size = usize::try_from(size).map_err(io::Error::other)?;
        let (value, more) = values.split_at_checked(size).ok_or_else(truncated_error)?;
        values = more;
        // Types 8 and 9 are the numbers 0 and 1 without bytes.
        row.push(match kind {
            0 => SqliteValue::Null,
            8 | 9 => SqliteValue::Integer(kind - 8),
            7 => SqliteValue::Real(f64::from_bits(read_integer(value).cast_unsigned())),
            1..=6 => SqliteValue::Integer(read_integer(value)),
            _ if kind % 2 == 0 => SqliteValue::Bytes(value.to_vec()),
            _ => SqliteValue::Text(String::from_utf8_lossy(value).into_owned()),
        });
    }
    Ok(row)
}

/// A signed integer, the highest byte first.
fn read_integer(bytes: &[u8]) -> i64 {
    let sign = bytes.first().is_some_and(|byte| byte & 0x80 != 0);
    let start = if sign { -1 } else { 0 };
    bytes.iter().fold(start, |value, byte| value << 8 | i64::from(*byte))
}

/// Names of the columns in a statement `CREATE TABLE`, and the position of the one that is the row number.
fn columns_of(says: &str) -> (Vec<String>, Option<usize>) {
    // The text between the outermost parentheses.
    let inside = says.split_once('(').map_or("", |(_, rest)| rest);
    let inside = inside.rsplit_once(')').map_or("", |(inside, _)| inside);
    // Split at commas outside of inner parentheses.
    let mut parts = vec![String::new()];
    let mut open = 0_usize;
    for c in inside.chars() {
        match c {
            '(' => open += 1,
            ')' => open = open.saturating_sub(1),
            ',' if open == 0 => {
                parts.push(String::new());
                continue;
            }
            _ => {}
        }
        parts.last_mut().expect("there is one").push(c);
    }
    // The first word of each part is the name of a column, or starts a constraint of the table.
    let (mut columns, mut row_number) = (Vec::new(), None);
    for part in parts {
        let part = part.trim();
        let end = part.find(|c: char| c.is_whitespace() || c == '(');
        let (name, rest) = part.split_at(end.unwrap_or(part.len()));
        if name.is_empty() {
            continue;
        }
        let constraints = ["PRIMARY", "UNIQUE", "CHECK", "FOREIGN", "CONSTRAINT"];
        if constraints.iter().any(|word| name.eq_ignore_ascii_case(word)) {
            continue;
        }
        let rest: Vec<String> = (rest.split_whitespace()).map(str::to_ascii_uppercase).collect();
        // Such a column is an alias of the row number.
        if rest.starts_with(&["INTEGER".to_owned(), "PRIMARY".to_owned(), "KEY".to_owned()]) {
            row_number = Some(columns.len());
        }
        columns.push(name.trim_matches(['"', '`', '[', ']', '\'']).to_owned());
    }
    (columns, row_number)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn numbers_keep_their_signs() {
        assert_eq!(read_integer(&[0xff]), -1);
        assert_eq!(read_integer(&[0x80, 0]), -32768);
        assert_eq!(read_integer(&[0x7f, 0xff, 0xff]), 0x7f_ffff);
        assert_eq!(read_varint(&mut &[0x81, 0][..]).unwrap(), 128);
        assert_eq!(read_varint(&mut &[0xff; 9][..]).unwrap(), -1);
        assert!(read_varint(&mut &[0x81][..]).is_err());
    }

    #[test]
    fn columns_are_told_from_constraints() {
        let says =
            "CREATE TABLE \"m\"(id INTEGER PRIMARY KEY, \"topic_id\" INTEGER NOT NULL, n DECIMAL(3, 4), UNIQUE(id, n))";
        let (columns, row_number) = columns_of(says);
        assert_eq!(columns, ["id", "topic_id", "n"]);
        assert_eq!(row_number, Some(0));
    }
}
