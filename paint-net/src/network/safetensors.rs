//! The safetensors format, as far as networks of `f32` need it: eight bytes with the length of a JSON header, the header
//! (`name → dtype, shape, data_offsets`), and the numbers, little-endian.

use std::fmt::Write as _;

use crate::error::Error;

/// A named tensor: extents and values.
#[derive(Debug, Clone, PartialEq)]
pub(crate) struct Tensor {
    pub(crate) name: String,
    pub(crate) shape: Vec<usize>,
    pub(crate) values: Vec<f32>,
}

/// Notes of a file: names and texts.
pub(crate) type Notes = Vec<(String, String)>;

/// Headers longer than this are refused; the format itself allows 100 MB.
const LONGEST_HEADER: usize = 1 << 20;

/// The bytes of a file with these tensors, in this order, and notes.
pub(crate) fn write(tensors: &[Tensor], notes: &[(&str, String)]) -> Vec<u8> {
    let mut header = String::from("{\"__metadata__\":{");
    for (k, (name, note)) in notes.iter().enumerate() {
        let comma = if k > 0 { "," } else { "" };
        // Writing into a string cannot fail.
        let _ = write!(header, "{comma}\"{}\":\"{}\"", escape(name), escape(note));
    }
    header.push('}');
    let mut at = 0;
    for t in tensors {
        let end = at + 4 * t.values.len();
        let shape: Vec<String> = t.shape.iter().map(ToString::to_string).collect();
        let (name, shape) = (escape(&t.name), shape.join(","));
        let _ = write!(header, ",\"{name}\":{{\"dtype\":\"F32\",\"shape\":[{shape}],\"data_offsets\":[{at},{end}]}}");
        at = end;
    }
    header.push('}');
    // Numbers start at a multiple of eight.
    while header.len() % 8 != 0 {
        header.push(' ');
    }
    let mut bytes = (header.len() as u64).to_le_bytes().to_vec();
    bytes.extend_from_slice(header.as_bytes());
    bytes.extend(tensors.iter().flat_map(|t| &t.values).flat_map(|v| v.to_le_bytes()));
    bytes
}

fn escape(text: &str) -> String {
    text.chars()
        .filter(|c| !c.is_control())
        .flat_map(|c| {
            let slash = matches!(c, '"' | '\\').then_some('\\');
            slash.into_iter().chain([c])
        })
        .collect()
}

/// Tensors and notes of a file.
pub(crate) fn read(bytes: &[u8]) -> Result<(Vec<Tensor>, Notes), Error> {
    let bad = |why: &'static str| Error::Weights(why.to_string());
    let (length, rest) = bytes.split_first_chunk::<8>().ok_or_else(|| bad("shorter than its header"))?;
    let length = usize::try_from(u64::from_le_bytes(*length)).unwrap_or(usize::MAX);
    if length > LONGEST_HEADER || length > rest.len() {
        return Err(bad("the header is longer than the file: not safetensors, or cut off"));
    }
    let (header, data) = rest.split_at(length);
    let header = std::str::from_utf8(header).map_err(|_| bad("the header is not text: not safetensors"))?;
    let Some(Value::Object(entries)) = Parser { text: header.trim_end(), depth: 0 }.whole() else {
        return Err(bad("the header is not a JSON object: not safetensors"));
    };
    let (mut tensors, mut notes) = (Vec::new(), Vec::new());
    for (name, value) in entries {
        let Value::Object(fields) = value else { return Err(bad("an entry of the header is not an object")) };
        if name == "__metadata__" {
            notes.extend(fields.into_iter().filter_map(|(k, v)| match v {
                Value::Text(text) => Some((k, text)),
                Value::Object(_) | Value::List(_) | Value::Whole => None,
            }));
            continue;
        }
        tensors.push(tensor(name, &fields, data)?);
    }
    Ok((tensors, notes))
}

fn tensor(name: String, fields: &[(String, Value)], data: &[u8]) -> Result<Tensor, Error> {
    let field = |key: &str| fields.iter().find(|(k, _)| k == key).map(|(_, v)| v);
    let bad = |why: &str| Error::Weights(format!("tensor {name} {why}"));
    if !matches!(field("dtype"), Some(Value::Text(t)) if t == "F32") {
        return Err(bad("is not F32"));
    }
    let list = |key: &str| match field(key) {
        Some(Value::List(list)) => Ok(list.clone()),
        _ => Err(bad("lacks its shape or offsets")),
    };
    let (shape, offsets) = (list("shape")?, list("data_offsets")?);
    let count = shape.iter().try_fold(4_usize, |n, &k| n.checked_mul(k)).ok_or_else(|| bad("is too large"))?;
    let &[from, to] = offsets.as_slice() else { return Err(bad("does not have two offsets")) };
    let bytes =
        data.get(from..to).filter(|b| b.len() == count).ok_or_else(|| bad("does not fit the file: cut off?"))?;
    let values = bytes.as_chunks::<4>().0.iter().map(|b| f32::from_le_bytes(*b)).collect();
    Ok(Tensor { name, shape, values })
}

/// As much of JSON as headers hold.
enum Value {
    Object(Vec<(String, Value)>),
    List(Vec<usize>),
    Text(String),
    /// No header needs it outside of lists.
    Whole,
}

struct Parser<'a> {
    text: &'a str,
    depth: usize,
}

impl Parser<'_> {
    fn whole(mut self) -> Option<Value> {
        let value = self.value()?;
        self.text.trim_start().is_empty().then_some(value)
    }

    fn take(&mut self, token: char) -> bool {
        self.text = self.text.trim_start();
        self.text.strip_prefix(token).map(|rest| self.text = rest).is_some()
    }

    fn value(&mut self) -> Option<Value> {
        if self.take('{') {
            // Headers nest twice.
            self.depth += 1;
            if self.depth > 4 {
                return None;
            }
            let entries = self.list('}', |p| {
                let key = p.take('"').then(|| p.string()).flatten()?;
                p.take(':').then(|| p.value()).flatten().map(|value| (key, value))
            });
            self.depth -= 1;
            entries.map(Value::Object)
        } else if self.take('[') {
            self.list(']', Self::number).map(Value::List)
        } else if self.take('"') {
            self.string().map(Value::Text)
        } else {
            self.number().map(|_| Value::Whole)
        }
    }

    fn list<R>(&mut self, end: char, mut item: impl FnMut(&mut Self) -> Option<R>) -> Option<Vec<R>> {
        let mut items = Vec::new();
        if self.take(end) {
            return Some(items);
        }
        loop {
            items.push(item(self)?);
            if self.take(end) {
                return Some(items);
            }
            if !self.take(',') {
                return None;
            }
        }
    }

    fn number(&mut self) -> Option<usize> {
        self.text = self.text.trim_start();
        let digits = self.text.len() - self.text.trim_start_matches(|c: char| c.is_ascii_digit()).len();
        let (number, rest) = self.text.split_at(digits);
        self.text = rest;
        number.parse().ok()
    }

    /// The rest of a string, up to its closing quote.
    fn string(&mut self) -> Option<String> {
        let mut text = String::new();
        let mut characters = self.text.chars();
        loop {
            match characters.next()? {
                '"' => break,
                '\\' => match characters.next()? {
                    c @ ('"' | '\\' | '/') => text.push(c),
                    _ => return None,
                },
                c => text.push(c),
            }
        }
        self.text = characters.as_str();
        Some(text)
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn tensors_and_notes_come_back() {
        let tensors = [
            Tensor { name: "a \"b\"".into(), shape: vec![2, 1], values: vec![1.5, -0.0] },
            Tensor { name: "c".into(), shape: vec![], values: vec![f32::MIN_POSITIVE] },
        ];
        let bytes = write(&tensors, &[("seed", "7\\".into())]);
        let (read_tensors, notes) = read(&bytes).unwrap();
        assert_eq!(read_tensors, tensors);
        assert_eq!(notes, [("seed".to_string(), "7\\".to_string())]);
        for cut in 0..bytes.len() {
            assert!(matches!(read(&bytes[..cut]), Err(Error::Weights(_))), "cut at {cut}");
        }
    }

    #[test]
    fn reads_a_file_of_the_reference_implementation() {
        // By hand after the format's own example: header of 0x40 bytes, one tensor of 1 and 2.
        let header = r#"{"x":{"dtype":"F32","shape":[2],"data_offsets":[0,8]}}          "#;
        let mut bytes = vec![0x40, 0, 0, 0, 0, 0, 0, 0];
        bytes.extend_from_slice(header.as_bytes());
        bytes.extend_from_slice(&[0, 0, 0x80, 0x3f, 0, 0, 0, 0x40]);
        assert_eq!(header.len(), 0x40);
        let (tensors, _) = read(&bytes).unwrap();
        assert_eq!(tensors, [Tensor { name: "x".into(), shape: vec![2], values: vec![1.0, 2.0] }]);
    }

    #[test]
    fn foreign_bytes_are_named() {
        for bytes in [
            &b""[..],
            b"\x89PNG\r\n\x1a\n0000000000000",
            b"\x02\0\0\0\0\0\0\0[]",
            b"\x08\0\0\0\0\0\0\0{{{{{{{{",
            b"\x24\0\0\0\0\0\0\0{\"a\":{\"dtype\":\"F16\",\"shape\":[1],\"d\":[0]}",
        ] {
            assert!(matches!(read(bytes), Err(Error::Weights(_))));
        }
    }
}
