//! File names in texts for people, instead of whole paths.

use std::path::PathBuf;

/// The folders of the inputs, and their names.
#[derive(Default)]
pub struct FileNames {
    /// With the separator at the end, longest first.
    folders: Vec<String>,
    inputs: String,
}

impl FileNames {
    /// Of the files that were given.
    pub fn of(inputs: &[PathBuf]) -> Self {
        let prefix = |file: &PathBuf| {
            let (file, name) = (file.to_str()?, file.file_name()?.to_str()?);
            file.strip_suffix(name).filter(|folder| !folder.is_empty()).map(str::to_owned)
        };
        let mut folders: Vec<String> = inputs.iter().filter_map(prefix).collect();
        folders.sort_unstable_by_key(|folder| std::cmp::Reverse(folder.len()));
        folders.dedup();
        let mut names = FileNames { folders, inputs: String::new() };
        let inputs: Vec<String> =
            inputs.iter().map(|file| names.shorten(&file.display().to_string())).collect();
        names.inputs = inputs.join(" ");
        names
    }

    /// The names of the inputs.
    pub fn inputs(&self) -> &str {
        &self.inputs
    }

    /// A text that may begin with the path of a file in the folder of an input, without that folder.
    pub fn shorten(&self, text: &str) -> String {
        let inside = self.folders.iter().find_map(|folder| text.strip_prefix(folder.as_str()));
        inside.unwrap_or(text).to_owned()
    }
}
