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
pub(super) enum Value {
    Null,
    Whole(i64),
    Real(f64),
    Text(String),
    Bytes(Vec<u8>),
}

impl Value {
    pub(super) fn whole(&self) -> Option<i64> {
        match self {
            Self::Whole(value) => Some(*value),
            _ => None,
        }
    }

    pub(super) fn text(&self) -> &str {
        match self {
            Self::Text(text) => text,
            _ => "",
        }
    }
}

/// An open database.
pub(super) struct Database<R> {
    stream: R,
    page_size: usize,
    /// Bytes of a page that hold data.
    usable: usize,
    pages: u64,
    tables: Vec<Table>,
}

/// A table: its columns in their order.
#[derive(Clone, Debug, PartialEq)]
pub(super) struct Table {
    name: String,
    root: u32,
    columns: Vec<String>,
    /// The column that is the number of the row, which is stored outside of it.
    row_number: Option<usize>,
}

impl<R: Read + Seek> Database<R> {
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
            return Err(io::Error::other("its header makes no sense"));
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
        let schema = Table {
            name: String::new(),
            root: 1,
            columns: Vec::new(),
            row_number: None,
        };
        let mut tables = Vec::new();
        database.rows(&schema, &mut |row| {
            if let [
                kind,
                Value::Text(name),
                _,
                Value::Whole(root),
                Value::Text(says),
                ..,
            ] = &row[..]
                && kind.text() == "table"
                && let Ok(root) = u32::try_from(*root)
            {
                let (columns, row_number) = columns_of(says);
                tables.push(Table {
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
    pub(super) fn show(
        &mut self,
        table: &str,
        columns: &[&str],
        show: &mut dyn FnMut(Vec<Value>) -> io::Result<()>,
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
        self.rows(&table, &mut |mut row| {
            let values = places.iter().map(|place| match row.get_mut(*place) {
                Some(value) => std::mem::replace(value, Value::Null),
                None => Value::Null,
            });
            show(values.collect())
        })?;
        Ok(true)
    }

    fn rows(
        &mut self,
        table: &Table,
        show: &mut dyn FnMut(Vec<Value>) -> io::Result<()>,
    ) -> io::Result<()> {
        // Every page is looked at once at most, so that a circle ends.
        let mut left = self.pages;
        self.tree(table, table.root, 0, &mut left, show)
    }

    fn tree(
        &mut self,
        table: &Table,
        number: u32,
        depth: usize,
        left: &mut u64,
        show: &mut dyn FnMut(Vec<Value>) -> io::Result<()>,
    ) -> io::Result<()> {
        if depth > DEEPEST || *left == 0 {
            return Err(io::Error::other("its pages run in circles"));
        }
        *left -= 1;
        let page = self.page(number)?;
        let start = if number == 1 { 100 } else { 0 };
        let kind = page[start];
        let cells = usize::from(short(&page, start + 3)?);
        let pointers = match kind {
            LEAF => start + 8,
            BRANCH => start + 12,
            _ => return Err(io::Error::other("a page of it is no table")),
        };
        for i in 0..cells {
            let at = usize::from(short(&page, pointers + 2 * i)?);
            if kind == BRANCH {
                self.tree(table, long(&page, at)?, depth + 1, left, show)?;
            } else {
                let (number, payload) = self.cell(&page, at, left)?;
                let mut row = record(&payload)?;
                if let Some(place) = table.row_number
                    && row.get(place) == Some(&Value::Null)
                {
                    row[place] = Value::Whole(number);
                }
                show(row)?;
            }
        }
        if kind == BRANCH {
            self.tree(table, long(&page, start + 8)?, depth + 1, left, show)?;
        }
        Ok(())
    }

    /// The number of a row and its bytes, those of further pages among them.
    fn cell(&mut self, page: &[u8], at: usize, left: &mut u64) -> io::Result<(i64, Vec<u8>)> {
        let mut cell = page.get(at..self.usable).ok_or_else(cut)?;
        let length = varint(&mut cell)?.cast_unsigned();
        let number = varint(&mut cell)?;
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
        let mut payload = cell.get(..here).ok_or_else(cut)?.to_vec();
        if here < length {
            let mut next = long(cell, here)?;
            while payload.len() < length {
                if next == 0 || *left == 0 {
                    return Err(cut());
                }
                *left -= 1;
                let page = self.page(next)?;
                next = long(&page, 0)?;
                let n = (length - payload.len()).min(self.usable - 4);
                payload.extend_from_slice(&page[4..4 + n]);
            }
        }
        Ok((number, payload))
    }

    fn page(&mut self, number: u32) -> io::Result<Vec<u8>> {
        if number == 0 || u64::from(number) > self.pages {
            return Err(cut());
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

fn cut() -> io::Error {
    io::Error::other("it refers to bytes that it does not have")
}

fn short(bytes: &[u8], at: usize) -> io::Result<u16> {
    let found = bytes.get(at..at + 2).ok_or_else(cut)?;
    Ok(u16::from_be_bytes([found[0], found[1]]))
}

fn long(bytes: &[u8], at: usize) -> io::Result<u32> {
    let found = bytes.get(at..at + 4).ok_or_else(cut)?;
    Ok(u32::from_be_bytes([found[0], found[1], found[2], found[3]]))
}

/// A number of one to nine bytes, the highest first; the ninth byte counts whole.
fn varint(bytes: &mut &[u8]) -> io::Result<i64> {
    let mut value = 0_u64;
    for i in 0..9 {
        let (byte, rest) = bytes.split_first().ok_or_else(cut)?;
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
fn record(bytes: &[u8]) -> io::Result<Vec<Value>> {
    let mut rest = bytes;
    let length = usize::try_from(varint(&mut rest)?).map_err(|_| cut())?;
    let mut values = bytes.get(length..).ok_or_else(cut)?;
    let mut types = &bytes[bytes.len() - rest.len()..];
    types = types
        .get(..length.saturating_sub(bytes.len() - rest.len()))
        .ok_or_else(cut)?;
    let mut row = Vec::new();
    while !types.is_empty() {
        let kind = varint(&mut types)?;
        let size = match kind {
            0 | 8 | 9 => 0,
            1..=4 => kind,
            5 => 6,
            6 | 7 => 8,
            12.. => (kind - 12) / 2,
            _ => return Err(io::Error::other("a row of it has a value of no type")),
        };
        let size = usize::try_from(size).map_err(io::Error::other)?;
        let (value, more) = values.split_at_checked(size).ok_or_else(cut)?;
        values = more;
        row.push(match kind {
            0 => Value::Null,
            8 | 9 => Value::Whole(kind - 8),
            7 => Value::Real(f64::from_bits(whole(value).cast_unsigned())),
            1..=6 => Value::Whole(whole(value)),
            _ if kind % 2 == 0 => Value::Bytes(value.to_vec()),
            _ => Value::Text(String::from_utf8_lossy(value).into_owned()),
        });
    }
    Ok(row)
}

/// A whole number with a sign, the highest byte first.
fn whole(bytes: &[u8]) -> i64 {
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
        assert_eq!(whole(&[0xff]), -1);
        assert_eq!(whole(&[0x80, 0]), -32768);
        assert_eq!(whole(&[0x7f, 0xff, 0xff]), 0x7f_ffff);
        assert_eq!(varint(&mut &[0x81, 0][..]).unwrap(), 128);
        assert_eq!(varint(&mut &[0xff; 9][..]).unwrap(), -1);
        assert!(varint(&mut &[0x81][..]).is_err());
    }

    #[test]
    fn columns_are_told_from_constraints() {
        let says = "CREATE TABLE \"m\"(id INTEGER PRIMARY KEY, \"topic_id\" INTEGER NOT NULL, n DECIMAL(3, 4), UNIQUE(id, n))";
        let (columns, row_number) = columns_of(says);
        assert_eq!(columns, ["id", "topic_id", "n"]);
        assert_eq!(row_number, Some(0));
    }
}
