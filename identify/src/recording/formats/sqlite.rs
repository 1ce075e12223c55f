//! Tables of a SQLite database, row by row, read only.
//!
//! A database is pages of equal size; a table is a tree of them with a row in each cell of a leaf, and what does not fit
//! into a cell goes on in a chain of further pages (sqlite.org/fileformat2.html, sections 1.3, 1.6 and 2.1). Indices, views
//! and a log that was not merged yet are not looked at.
//!
//! Decision: a reader of our own, because only the rows of two tables are needed. It takes no more memory than one
//! page.

use std::io::{self, Read, Seek, SeekFrom};

/// Trees that are higher hold more than any disk.
const DEEPEST: usize = 24;
/// The longest row.
const LONGEST_ROW: u64 = 256 << 20;

/// What begins a database.
pub(super) const MAGIC: &[u8; 16] = b"SQLite format 3\0";

/// A value of a row.
#[derive(Clone, Debug, PartialEq)]
pub(super) enum SqliteValue {
    Null,
    Integer(i64),
    Real(f64),
    Text(String),
    Bytes(Vec<u8>),
}

impl SqliteValue {
    pub(super) fn as_integer(&self) -> Option<i64> {
        match self {
            Self::Integer(value) => Some(*value),
            _ => None,
        }
    }

    pub(super) fn as_text(&self) -> &str {
        match self {
            Self::Text(text) => text,
            _ => "",
        }
    }
}

/// An open database.
pub(super) struct SqliteDatabase<R> {
    stream: R,
    page_size: usize,
    /// Bytes of a page that hold data.
    usable: usize,
    pages: u64,
    tables: Vec<SqliteTable>,
}

/// A table: its columns in their order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct SqliteTable {
    name: String,
    root: u32,
    columns: Vec<String>,
    /// The column that is the number of the row, which is stored outside of it.
    row_number: Option<usize>,
}

impl<R: Read + Seek> SqliteDatabase<R> {
    /// Reads the list of tables.
    pub(super) fn open(mut stream: R) -> io::Result<Self> {
        let length = stream.seek(SeekFrom::End(0))?;
        stream.rewind()?;
        let mut head = [0; 100];
        stream.read_exact(&mut head)?;
        let page_size = match u16::from_be_bytes([head[16], head[17]]) {
            1 => 1 << 16,
            size => usize::from(size),
        };
        let reserved = usize::from(head[20]);
        if !head.starts_with(MAGIC) || !page_size.is_power_of_two() || page_size < reserved + 480 {
            return Err(io::Error::other("its header is not valid"));
        }
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
        let schema = SqliteTable {
            name: String::new(),
            root: 1,
            columns: Vec::new(),
            row_number: None,
        };
        let mut tables = Vec::new();
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

    /// Shows the rows of a table, each with the values of `columns`; whether there is such a table.
    ///
    /// Fails when the table lacks a column, and when its pages make no sense.
    pub(super) fn visit_rows(
        &mut self,
        table: &str,
        columns: &[&str],
        show: &mut dyn FnMut(Vec<SqliteValue>) -> io::Result<()>,
    ) -> io::Result<bool> {
        let Some(table) = self.tables.iter().find(|one| one.name == table).cloned() else {
            return Ok(false);
        };
        let places = columns.iter().map(|name| {
            let place = table.columns.iter().position(|other| other == name);
            place.ok_or_else(|| {
                io::Error::other(format!("its table `{}` has no column `{name}`", table.name))
            })
        });
        let places = places.collect::<io::Result<Vec<usize>>>()?;
        self.visit_all_rows(&table, &mut |mut row| {
            let values = places.iter().map(|place| match row.get_mut(*place) {
                Some(value) => std::mem::replace(value, SqliteValue::Null),
                None => SqliteValue::Null,
            });
            show(values.collect())
        })?;
        Ok(true)
    }

    fn visit_all_rows(
        &mut self,
        table: &SqliteTable,
        show: &mut dyn FnMut(Vec<SqliteValue>) -> io::Result<()>,
    ) -> io::Result<()> {
        // Every page is looked at once at most, so that a circle ends.
        let mut left = self.pages;
        self.visit_tree(table, table.root, 0, &mut left, show)
    }

    fn visit_tree(
        &mut self,
        table: &SqliteTable,
        number: u32,
        depth: usize,
        left: &mut u64,
        show: &mut dyn FnMut(Vec<SqliteValue>) -> io::Result<()>,
    ) -> io::Result<()> {
        if depth > DEEPEST || *left == 0 {
            return Err(io::Error::other("its pages run in circles"));
        }
        *left -= 1;
        let page = self.read_page(number)?;
        let start = if number == 1 { 100 } else { 0 };
        let kind = page[start];
        let cells = usize::from(read_u16(&page, start + 3)?);
        let pointers = match kind {
            LEAF => start + 8,
            BRANCH => start + 12,
            _ => return Err(io::Error::other("a page of it is not part of a table")),
        };
        for i in 0..cells {
            let at = usize::from(read_u16(&page, pointers + 2 * i)?);
            if kind == BRANCH {
                self.visit_tree(table, read_u32(&page, at)?, depth + 1, left, show)?;
            } else {
                let (number, payload) = self.read_cell(&page, at, left)?;
                let mut row = read_record(&payload)?;
                if let Some(place) = table.row_number
                    && row.get(place) == Some(&SqliteValue::Null)
                {
                    row[place] = SqliteValue::Integer(number);
                }
                show(row)?;
            }
        }
        if kind == BRANCH {
            self.visit_tree(table, read_u32(&page, start + 8)?, depth + 1, left, show)?;
        }
        Ok(())
    }

    /// The number of a row and its bytes, those of further pages among them.
    fn read_cell(&mut self, page: &[u8], at: usize, left: &mut u64) -> io::Result<(i64, Vec<u8>)> {
        let mut cell = page.get(at..self.usable).ok_or_else(truncated_error)?;
        let length = read_varint(&mut cell)?.cast_unsigned();
        let number = read_varint(&mut cell)?;
        if length > LONGEST_ROW {
            return Err(io::Error::other("a row of it is longer than 256 MB"));
        }
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

/// Kinds of pages.
const LEAF: u8 = 0x0d;
const BRANCH: u8 = 0x05;

fn truncated_error() -> io::Error {
    io::Error::other("it refers to bytes that it does not have")
}

fn read_u16(bytes: &[u8], at: usize) -> io::Result<u16> {
    let found = bytes.get(at..at + 2).ok_or_else(truncated_error)?;
    Ok(u16::from_be_bytes([found[0], found[1]]))
}

fn read_u32(bytes: &[u8], at: usize) -> io::Result<u32> {
    let found = bytes.get(at..at + 4).ok_or_else(truncated_error)?;
    Ok(u32::from_be_bytes([found[0], found[1], found[2], found[3]]))
}

/// A number of one to nine bytes, the highest first; the ninth byte counts whole.
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

/// The values of a row: their types stand in front.
fn read_record(bytes: &[u8]) -> io::Result<Vec<SqliteValue>> {
    let mut rest = bytes;
    let length = usize::try_from(read_varint(&mut rest)?).map_err(|_| truncated_error())?;
    let mut values = bytes.get(length..).ok_or_else(truncated_error)?;
    let mut types = &bytes[bytes.len() - rest.len()..];
    types = types
        .get(..length.saturating_sub(bytes.len() - rest.len()))
        .ok_or_else(truncated_error)?;
    let mut row = Vec::new();
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

/// A whole number with a sign, the highest byte first.
fn read_integer(bytes: &[u8]) -> i64 {
    let sign = bytes.first().is_some_and(|byte| byte & 0x80 != 0);
    let start = if sign { -1 } else { 0 };
    bytes
        .iter()
        .fold(start, |value, byte| value << 8 | i64::from(*byte))
}

/// Names of the columns that a statement `CREATE TABLE` makes, and which of them is the number of the row.
fn columns_of(says: &str) -> (Vec<String>, Option<usize>) {
    let inside = says.split_once('(').map_or("", |(_, rest)| rest);
    let inside = inside.rsplit_once(')').map_or("", |(inside, _)| inside);
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
    let (mut columns, mut row_number) = (Vec::new(), None);
    for part in parts {
        let part = part.trim();
        let end = part.find(|c: char| c.is_whitespace() || c == '(');
        let (name, rest) = part.split_at(end.unwrap_or(part.len()));
        if name.is_empty() {
            continue;
        }
        let constraints = ["PRIMARY", "UNIQUE", "CHECK", "FOREIGN", "CONSTRAINT"];
        if constraints
            .iter()
            .any(|word| name.eq_ignore_ascii_case(word))
        {
            continue;
        }
        let rest: Vec<String> = (rest.split_whitespace())
            .map(str::to_ascii_uppercase)
            .collect();
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
        let says = "CREATE TABLE \"m\"(id INTEGER PRIMARY KEY, \"topic_id\" INTEGER NOT NULL, n DECIMAL(3, 4), UNIQUE(id, n))";
        let (columns, row_number) = columns_of(says);
        assert_eq!(columns, ["id", "topic_id", "n"]);
        assert_eq!(row_number, Some(0));
    }
}
