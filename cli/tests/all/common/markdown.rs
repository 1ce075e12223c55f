//! Pages of Markdown as tests read them: blocks between fences, commands, links.

use std::collections::BTreeSet;
use std::fs;
use std::path::{Path, PathBuf};

/// A block between fences.
pub(crate) struct Block {
    /// Its language, empty if none is stated.
    pub(crate) language: String,
    pub(crate) text: String,
    /// Whether nothing but empty lines stands between it and the block before.
    pub(crate) follows: bool,
    /// What the first column of a table below the block has, in backticks, if its heading is `key`.
    pub(crate) keys_of_next_table: Vec<String>,
}

/// A page of Markdown: its blocks, and the lines outside of them.
pub(crate) struct Page {
    pub(crate) path: PathBuf,
    pub(crate) blocks: Vec<Block>,
    pub(crate) prose: String,
}

impl Page {
    pub(crate) fn read(path: &Path) -> Self {
        let text = fs::read_to_string(path).unwrap_or_else(|error| panic!("{}: {error}", path.display()));
        let mut page = Self {
            path: path.to_owned(),
            blocks: Vec::new(),
            prose: String::new(),
        };
        let mut inside = false;
        let mut follows = false;
        let mut has_keys = false;
        for line in text.lines() {
            if let Some(language) = line.strip_prefix("```") {
                if !inside {
                    page.blocks.push(Block {
                        language: language.to_owned(),
                        text: String::new(),
                        follows,
                        keys_of_next_table: Vec::new(),
                    });
                }
                inside = !inside;
                follows = true;
            } else if inside {
                let block = page.blocks.last_mut().expect("a block was opened");
                block.text.push_str(line);
                block.text.push('\n');
            } else {
                follows &= line.is_empty();
                has_keys = line.starts_with("| key |") || has_keys && line.starts_with('|');
                if let Some(block) = page.blocks.last_mut().filter(|_| has_keys) {
                    let first = line.split('|').nth(1).unwrap_or_default();
                    let keys = first.split('`').skip(1).step_by(2).map(str::to_owned);
                    block.keys_of_next_table.extend(keys);
                }
                page.prose.push_str(line);
                page.prose.push('\n');
            }
        }
        assert!(!inside, "{}: a block has no end", path.display());
        page
    }

    /// The commands of a block, each as its words.
    pub(crate) fn commands(block: &Block) -> Vec<Vec<String>> {
        if block.language != "sh" {
            return Vec::new();
        }
        let text = block.text.replace("\\\n", " ");
        text.lines()
            .map(words_of_shell)
            .filter(|words| words.first().is_some_and(|word| word == "modelmill"))
            .map(|words| words[1..].to_vec())
            .collect()
    }

    /// The anchors that headings make.
    pub(crate) fn anchors(&self) -> BTreeSet<String> {
        self.prose
            .lines()
            .filter(|line| line.starts_with('#'))
            .map(|line| {
                let title = line.trim_start_matches('#').trim().to_lowercase();
                title
                    .chars()
                    .filter(|c| c.is_alphanumeric() || matches!(c, ' ' | '-' | '_'))
                    .map(|c| if c == ' ' { '-' } else { c })
                    .collect()
            })
            .collect()
    }

    /// What links and pictures outside of code lead to, and files that are included.
    pub(crate) fn targets(&self) -> Vec<String> {
        let prose: String = self.prose.split('`').step_by(2).collect::<Vec<_>>().join("`");
        let links = prose.split("](").skip(1);
        let mut targets: Vec<String> = links
            .filter_map(|rest| rest.split_once(')'))
            .map(|(target, _)| target.to_owned())
            .collect();
        for block in &self.blocks {
            for rest in block.text.split("{{#include ").skip(1) {
                let path = rest.split([':', '}']).next().unwrap_or_default();
                targets.push(path.to_owned());
            }
        }
        targets
    }
}

/// Splits a line as a shell does, without what follows a comment sign.
fn words_of_shell(line: &str) -> Vec<String> {
    let mut words: Vec<String> = Vec::new();
    let mut quoted = false;
    let mut open = false;
    for c in line.chars() {
        match c {
            '"' => {
                quoted = !quoted;
                if quoted && !open {
                    words.push(String::new());
                    open = true;
                }
            }
            '#' if !quoted && !open => break,
            c if c.is_whitespace() && !quoted => open = false,
            c => {
                if !open {
                    words.push(String::new());
                    open = true;
                }
                words.last_mut().expect("a word was opened").push(c);
            }
        }
    }
    words
}
