//! The run file: which machine it is for, and how its stage and its laser are driven.

use serde::Deserialize;

/// The keys of a run file.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct RunFile {
    /// Name of the machine, as in its machine file: jobs for another one are refused.
    pub machine: String,
    /// How the stage is driven.
    pub stage: StageKeys,
    /// How the laser is driven.
    pub laser: LaserKeys,
}

/// A stage driver and its keys.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "driver", rename_all = "lowercase", deny_unknown_fields)]
pub enum StageKeys {
    /// LinuxCNC through its network shell, linuxcncrsh.
    Linuxcnc {
        /// Host and port, such as `localhost:5007`.
        address: String,
        /// Connection password of linuxcncrsh (-p); default: EMC.
        password: Option<String>,
        /// Enable password of linuxcncrsh (-e); default: EMCTOO.
        enable: Option<String>,
        /// MACHINE of section EMC of its INI file, which must be the same.
        identity: Option<String>,
    },
    /// GRBL 1.1 on a serial port.
    Grbl {
        /// The port, such as `/dev/ttyUSB0` or `COM3`.
        port: String,
        /// Bits per second; default: 115200.
        baud: Option<u32>,
        /// What `$I` must hold, such as the name set with `$I=`.
        identity: Option<String>,
    },
    /// A person moves the stage and says when it stands.
    Manual {},
}

/// A laser driver and its keys.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(tag = "driver", rename_all = "lowercase", deny_unknown_fields)]
pub enum LaserKeys {
    /// LightBurn on this or another computer, by UDP; it takes `lightburn` files.
    Lightburn {
        /// Host; default: localhost.
        address: Option<String>,
        /// The job folder as LightBurn's computer sees it, where that is another path.
        folder: Option<String>,
        /// Its port for commands; default: 19840.
        port: Option<u16>,
        /// The port that it answers to; default: 19841.
        answers: Option<u16>,
    },
    /// A BJJCZ (LMC) card over USB; it takes `lmc` files.
    Lmc {
        /// Serial number of the USB device, where there are several.
        serial: Option<String>,
        /// Field correction (.cor) that the card is given; default: none.
        correction: Option<String>,
    },
    /// A command of the user's, which ends when the block is marked, with 0 where it is.
    Command {
        /// Format of the files that it takes; default: those that the job holds, where there is one kind.
        format: Option<String>,
        /// The program and its arguments; `{file}`, `{block}` and `{shift}` (mm) are replaced.
        mark: Vec<String>,
        /// The same with the pilot laser.
        pilot: Option<Vec<String>>,
        /// A command that switches the laser off; called at every end.
        off: Option<Vec<String>>,
    },
    /// A scan card that listens to START and answers with BUSY, through the stage's control.
    Handshake {},
    /// A person loads and marks each block and says when it is done.
    Manual {},
}
