//! The run file: which machine it is for, and how its stage and its laser are driven.

use std::path::Path;
use std::sync::Arc;

use schemars::JsonSchema;
use serde::Deserialize;

use terrace_core::diag::{self, Diag, Error, Place};
use terrace_core::units::{Length, positive_option};

/// Where all keys of a run file are listed.
const KEYS: &str = "docs/reference/run-file.md lists all keys of a run file";

/// Largest run file that is read.
const MAX_FILE: u64 = 1 << 20;

/// The keys of a run file.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct RunFile {
    /// Name of the machine, as in its machine file; jobs for another machine are refused.
    #[schemars(extend("x-value" = "name"))]
    pub machine: String,
    /// How the stage is driven.
    pub stage: StageKeys,
    /// How the laser is driven.
    pub laser: LaserKeys,
}

impl RunFile {
    /// Reads a run file.
    ///
    /// # Errors
    /// The file's faults with their places.
    pub fn read(path: &Path) -> Result<Self, Error> {
        let shown = path.display().to_string();
        let text = diag::utf8(diag::read_file(path, MAX_FILE)?)
            .map_err(|e| e.at(Diag::input("run-file-utf8", format!("the run file is {e}")), &shown))?;
        let source: Arc<str> = text.into();
        let mut table = diag::parse_toml(&shown, &source, KEYS)?;
        for name in ["stage", "laser"] {
            let Some(found) = table.get_mut().get_mut(name) else { continue };
            let span = found.span();
            if let Err((fault, at)) = diag::by_tag(found.get_mut(), "driver") {
                let place = Place::Text { path: shown, source: Arc::clone(&source), span: at.unwrap_or(span) };
                return Err(fault.at(place).hint(KEYS).into());
            }
        }
        diag::from_table(&shown, &source, table, KEYS)
    }
}

/// The JSON schema of a run file.
pub fn json_schema() -> String {
    let schema = schemars::schema_for!(RunFile);
    serde_json::to_string_pretty(&schema).expect("a schema is plain JSON")
}

/// A stage driver and its keys.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[schemars(tag = "driver")]
pub enum StageKeys {
    /// LinuxCNC through its network shell, linuxcncrsh.
    Linuxcnc(LinuxCncKeys),
    /// GRBL 1.1 on a serial port.
    Grbl(GrblKeys),
    /// A person moves the stage and says when it stands.
    Manual(NoKeys),
}

/// A laser driver and its keys.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(rename_all = "lowercase")]
#[schemars(tag = "driver")]
pub enum LaserKeys {
    /// LightBurn on this or another computer, by UDP; it takes `lightburn` files.
    Lightburn(LightBurnKeys),
    /// A BJJCZ (LMC) card over USB; it takes `lmc` files.
    Lmc(LmcKeys),
    /// A command of the user's, which ends when the block is marked, with 0 where it is.
    Command(CommandKeys),
    /// A scan card that listens to START and answers with BUSY, through the stage's control.
    Handshake(NoKeys),
    /// A person loads and marks each block and says when it is done.
    Manual(NoKeys),
}

/// GRBL and how it is reached.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct GrblKeys {
    /// Serial port, such as `"/dev/ttyUSB0"` or `"COM3"`.
    pub port: String,
    /// Bits per second.
    #[schemars(extend("x-default" = "115200"))]
    pub baud: Option<u32>,
    /// What the answer to `$I` must hold, such as the name set with `$I=`.
    #[schemars(extend("x-default" = "not checked"))]
    pub identity: Option<String>,
}

/// LightBurn and how it is reached.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LightBurnKeys {
    /// Computer that LightBurn runs on.
    #[schemars(extend("x-default" = "\"localhost\""))]
    pub address: Option<String>,
    /// The job folder as that computer sees it.
    #[schemars(extend("x-value" = "path", "x-default" = "the same path"))]
    pub folder: Option<String>,
    /// Port that LightBurn listens to.
    #[schemars(extend("x-default" = "19840"))]
    pub port: Option<u16>,
    /// Port that it answers to.
    #[schemars(extend("x-default" = "19841"))]
    pub answers: Option<u16>,
}

/// A BJJCZ (LMC) card and how it is reached.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LmcKeys {
    /// Serial number of the USB device, where there are several.
    #[schemars(extend("x-default" = "the only one"))]
    pub serial: Option<String>,
    /// Field correction (`.cor`) that the card is given.
    #[schemars(extend("x-value" = "path"))]
    pub correction: Option<String>,
}

/// A driver without keys.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct NoKeys {}

/// LinuxCNC and how it is reached.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct LinuxCncKeys {
    /// Host and port of linuxcncrsh, such as `"localhost:5007"`.
    pub address: String,
    /// Its connection password (`-w`).
    #[schemars(extend("x-default" = "\"EMC\""))]
    pub password: Option<String>,
    /// Its enable password (`-e`).
    #[schemars(extend("x-default" = "\"EMCTOO\""))]
    pub enable: Option<String>,
    /// Its name (`-n`), which must be the same.
    #[schemars(extend("x-default" = "not checked"))]
    pub identity: Option<String>,
    /// How far an axis may stand from its target when the laser is started; 0.01 mm also stands for 0.01 degrees of a tilt axis.
    #[schemars(extend("x-default" = "\"0.01 mm\""))]
    #[serde(default, deserialize_with = "positive_option")]
    pub tolerance: Option<Length>,
}

/// A command and what it takes.
#[derive(Clone, Debug, PartialEq, Deserialize, JsonSchema)]
#[serde(deny_unknown_fields)]
pub struct CommandKeys {
    /// Format of the files that it takes, as in `emit.formats`.
    #[schemars(extend("x-default" = "the only one of the job"))]
    pub format: Option<String>,
    /// Program and arguments; it ends with 0 when the block is marked and the laser off.
    #[schemars(extend("x-value" = "list of words"))]
    pub mark: Vec<String>,
    /// The same with the pilot laser.
    #[schemars(extend("x-value" = "list of words"))]
    pub pilot: Option<Vec<String>>,
    /// Switches the laser off; called before the first block and at every end.
    #[schemars(extend("x-value" = "list of words"))]
    pub off: Option<Vec<String>>,
}

#[cfg(test)]
mod tests {
    use super::*;

    /// The faults of a run file: place, text and hint.
    fn faults(text: &str) -> Vec<String> {
        let folder = tempfile::tempdir().expect("a folder");
        let path = folder.path().join("run.toml");
        std::fs::write(&path, text).expect("written");
        let shown = path.display().to_string();
        match RunFile::read(&path) {
            Ok(_) => Vec::new(),
            Err(e) => {
                e.diags().iter().map(|d| format!("{}: {}", d.place, d.message).replace(&shown, "run.toml")).collect()
            }
        }
    }

    #[test]
    fn faults_of_a_driver_stand_at_their_key() {
        let stage = |keys: &str| faults(&format!("machine = \"a\"\n[stage]\n{keys}\n[laser]\ndriver = \"manual\"\n"));
        assert_eq!(stage("driver = \"grbl\"\nport = \"/dev/ttyUSB0\"\nbaud = 9600"), [""; 0]);
        for (keys, wanted) in [
            (
                "driver = \"grbl\"\nport = \"x\"\nbaud = \"fast\"",
                "run.toml:5:8: this is the text \"fast\", expected a whole number",
            ),
            ("driver = \"grbl\"\nport = \"x\"\nbuad = 9600", "run.toml:5:1: unknown field `buad`"),
            ("driver = \"grbl\"", "missing field `port`"),
            ("driver = \"gbrl\"\nport = \"x\"", "run.toml:3:10: unknown variant `gbrl`"),
            ("port = \"x\"", "missing field `driver`"),
            ("driver = 3\nport = \"x\"", "run.toml:3:10: driver is not a text"),
            ("driver = \"manual\"\nport = \"x\"", "run.toml:4:1: unknown field `port`"),
        ] {
            let found = stage(keys);
            assert!(found.len() == 1 && found[0].contains(wanted), "{keys}: {found:?}");
        }
    }
}
