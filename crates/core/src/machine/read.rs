//! How machine files are read: the built-in ones, those of a path, and what is wrong with values that can be read.

use std::path::Path;
use std::sync::Arc;

use super::{Cost, Dialect, Fault, LoadingWay, Machine, Probe, Tilt, ToolServo, range};
use crate::diag::{self, Diag, Error, Place, TableKey};
use crate::geom::Nm;

/// The built-in profiles: name and text.
pub const PROFILES: [(&str, &str); 6] = [
    ("xyz-galvo-40", include_str!("profiles/xyz-galvo-40.toml")),
    ("xyz-galvo-100", include_str!("profiles/xyz-galvo-100.toml")),
    ("xyz-tilt-galvo-40", include_str!("profiles/xyz-tilt-galvo-40.toml")),
    ("xyz-headtilt-galvo-40", include_str!("profiles/xyz-headtilt-galvo-40.toml")),
    ("xyz-zoom-40", include_str!("profiles/xyz-zoom-40.toml")),
    ("xyzac-galvo-10", include_str!("profiles/xyzac-galvo-10.toml")),
];

/// Where all keys of a machine file are listed.
const KEYS: &str =
    "`terrace machines NAME` prints a built-in machine to start from; `terrace machines --schema` lists every key";

/// The tables of a machine file.
const TABLES: [TableKey; 20] = {
    const fn one(name: &'static str) -> TableKey {
        TableKey { name, is_list: false, needed: None }
    }
    const fn needed(name: &'static str) -> TableKey {
        TableKey { name, is_list: false, needed: Some(KEYS) }
    }
    [
        needed("lens"),
        needed("scanner"),
        needed("stage"),
        needed("stage.x"),
        needed("stage.y"),
        needed("stage.z"),
        needed("laser"),
        one("delays"),
        one("controller"),
        one("zoom"),
        one("tilt"),
        TableKey { name: "tilt.axes", is_list: true, needed: Some("add two [[tilt.axes]]") },
        one("operator"),
        one("cost"),
        one("tool_servo"),
        one("tool_servo.drive"),
        TableKey { name: "tool_servo.oscillations", is_list: true, needed: None },
        one("lmc"),
        one("rtc"),
        one("probe"),
    ]
};

/// Largest machine file that is read.
const MAX_FILE: u64 = 1 << 20;

impl Machine {
    /// The built-in profile `name`.
    ///
    /// # Errors
    /// `machine-unknown` with the names there are.
    pub fn built_in(name: &str) -> Result<Self, Error> {
        let Some((_, text)) = PROFILES.iter().find(|(n, _)| *n == name) else {
            let names: Vec<_> = PROFILES.iter().map(|(n, _)| *n).collect();
            return Err(Diag::input("machine-unknown", format!("there is no built-in machine {name:?}"))
                .hint(format!("built in are {}; or name a file with machine.file", names.join(", ")))
                .into());
        };
        Self::parse(&format!("built-in {name}"), text)
    }

    /// Reads and checks a machine file.
    ///
    /// # Errors
    /// The file's faults with their places.
    pub fn load(path: &Path) -> Result<Self, Error> {
        let shown = path.display().to_string();
        let bytes = diag::read_file(path, MAX_FILE)?;
        let text = diag::utf8(bytes)
            .map_err(|e| e.at(Diag::input("machine-utf8", format!("the machine file is {e}")), &shown))?;
        Self::parse(&shown, &text)
    }

    pub(super) fn parse(path: &str, text: &str) -> Result<Self, Error> {
        let source: Arc<str> = text.into();
        if diag::has_keys(text, &["surface", "texture"]) {
            let d = Diag::input("not-a-machine", "this is a job file, not a machine file").at(Place::file(path));
            return Err(d.hint("name a machine file: `terrace machines NAME -o FILE` writes one to start from").into());
        }
        let faults = diag::table_faults(Path::new(path), &source, "machine file", &TABLES);
        if !faults.is_empty() {
            return Err(Error::many(faults));
        }
        let machine: Self = diag::from_toml(path, &source, KEYS)?;
        let at = |(key, d): Fault| d.at(diag::place_of(path, &source, &key));
        let faults: Vec<Diag> = machine.faults().into_iter().map(at).collect();
        if faults.is_empty() { Ok(machine) } else { Err(Error::many(faults)) }
    }

    /// What is wrong with values that can be read.
    fn faults(&self) -> Vec<Fault> {
        let mut faults: Vec<Fault> = range::faults(self).collect();
        faults.extend(self.travel_faults());
        faults.extend(self.table_fault());
        faults.extend(self.lens_faults());
        if !(1..=1_000_000).contains(&self.increment_nm().0) {
            let text = "stage.increment is not between 1 nm and 1 mm";
            faults.push(fault("machine-increment", "stage.increment", text, "0.1 um is usual"));
        }
        faults.extend(self.servo_faults());
        if !(1.0..=1000.0).contains(&self.laser.m2) {
            let text = "laser.m2 is not between 1 and 1000";
            let hint = "1 is an ideal beam, single-mode fibre lasers have 1.1 to 1.3";
            faults.push(fault("machine-m2", "laser.m2", text, hint));
        }
        if !(40..=1_000_000).contains(&self.controller.max_line) {
            let text = "controller.max_line is not between 40 and 1000000 characters";
            faults.push(fault("machine-line", "controller.max_line", text, "255 is usual, 80 with GRBL"));
        }
        faults.extend(self.card_faults());
        faults.extend(self.dialect_faults());
        faults.extend(self.tilt.iter().flat_map(Tilt::faults));
        faults.extend(self.probe.iter().flat_map(Probe::faults));
        faults.extend(self.cost.iter().flat_map(Cost::faults));
        faults.extend(self.tool_servo.iter().flat_map(ToolServo::faults));
        faults
    }

    /// Travel of X, Y and Z that is empty or cannot be counted in nm.
    fn travel_faults(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        for (name, axis) in self.axes() {
            let key = format!("stage.{name}.travel");
            if axis.travel[0] >= axis.travel[1] {
                let text = format!("{key} [{}, {}] is empty", axis.travel[0], axis.travel[1]);
                faults.push(fault("machine-travel", &key, text, "write the lower end first"));
            }
            if axis.travel.iter().any(|t| t.as_nm().is_none()) {
                faults.push(fault("machine-travel", &key, format!("{key} is beyond 4 m"), "check the unit"));
            }
        }
        faults
    }

    /// A table that no stage reaches, or that tilts.
    fn table_fault(&self) -> Option<Fault> {
        let table = self.stage.table?;
        if table.as_nm().is_none() {
            let text = format!("stage.table {table} is beyond 4 m");
            return Some(fault("machine-table", "stage.table", text, "check the unit"));
        }
        self.tilt.as_ref()?;
        let text = "stage.table is the height of a level table, but the machine has [tilt]";
        Some(fault(
            "machine-table",
            "stage.table",
            text,
            "leave it out, and give the table as a [[fixture]] of the job",
        ))
    }

    /// Fields that no lens has, and figures over the field that do not reach its corners.
    fn lens_faults(&self) -> Vec<Fault> {
        /// Below any lens: most often a slip of the unit.
        const LEAST_FIELD: Nm = Nm(5_000);
        let mut faults = Vec::new();
        let usable = self.usable_field();
        if usable.iter().any(|&w| w < LEAST_FIELD) {
            let [w, h] = usable.map(Nm::mm);
            let text = format!("lens.field less lens.margin on every side leaves {w} x {h} mm, less than 0.005 mm");
            let hint = "give the full sizes of the field; check their unit";
            faults.push(fault("machine-field", "lens.field", text, hint));
        } else if self.lens.field.iter().any(|f| f.as_mm() > 1000.0) {
            faults.push(fault("machine-field", "lens.field", "lens.field is beyond 1 m", "check the unit"));
        }
        let farthest = self.farthest_in_field();
        let over_field = [
            ("lens.telecentricity", self.lens.telecentricity.as_ref().and_then(|v| v.fault(farthest))),
            ("lens.field_residual", self.lens.field_residual.as_ref().and_then(|v| v.fault(farthest))),
        ];
        for (key, why) in over_field {
            if let Some(why) = why {
                let hint = "state it from the axis to the farthest corner";
                faults.push(fault("machine-over-field", key, format!("{key}: {why}"), hint));
            }
        }
        faults
    }

    /// Damping that no servo has.
    fn servo_faults(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        let tool = self.tool_servo.as_ref().and_then(|tool| tool.servo);
        for (name, servo) in [("stage", self.stage.servo), ("scanner", self.scanner.servo), ("tool_servo", tool)] {
            if servo.is_some_and(|s| !(0.01..=10.0).contains(&s.damping)) {
                let key = format!("{name}.servo.damping");
                let text = format!("{key} is not between 0.01 and 10");
                faults.push(fault("machine-servo", &key, text, "0.7 is usual"));
            }
        }
        faults
    }

    /// Scales and list memory that no scan card has.
    fn card_faults(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        let scales = [
            ("lmc.units_per_mm", self.lmc.map(|lmc| lmc.units_per_mm)),
            ("rtc.bits_per_mm", self.rtc.map(|rtc| rtc.bits_per_mm)),
            ("rtc.focus_bits_per_mm", self.rtc.and_then(|rtc| rtc.focus_bits_per_mm)),
        ];
        for (key, scale) in scales {
            if scale.is_some_and(|scale| !(1.0..=1e6).contains(&scale)) {
                let hint = "it is the range of the card divided by the width of the field";
                faults.push(fault("machine-scale", key, format!("{key} is not between 1 and 1e6"), hint));
            }
        }
        if self.rtc.is_some_and(|rtc| !(100..=8_000_000).contains(&rtc.list_memory)) {
            let text = "rtc.list_memory is not between 100 and 8000000 commands";
            faults.push(fault("machine-list", "rtc.list_memory", text, "4000 is the default of the boards"));
        }
        faults
    }

    /// What the dialect of the stage's control cannot do, and what no control does.
    fn dialect_faults(&self) -> Vec<Fault> {
        let mut faults = Vec::new();
        if self.operator.way == Some(LoadingWay::Card) && self.controller.dialect != Dialect::Linuxcnc {
            let text = "operator.way is \"card\", but the handshake that starts the card is for LinuxCNC, and \
                        controller.dialect is another";
            let hint = "state operator.way = \"run\" or \"person\", or the control that moves the stage";
            faults.push(fault("operator-way", "operator.way", text, hint));
        }
        if self.controller.dialect == Dialect::Grbl && self.tilt.is_some() {
            let text =
                "controller.dialect is \"grbl\", but GRBL has the axes X, Y and Z alone, and the machine has [tilt]";
            let hint = "state the control that moves the tilt axes: \"linuxcnc\" or \"mach\"";
            faults.push(fault("machine-dialect", "controller.dialect", text, hint));
        }
        if self.stage.diagonal && self.tilt.is_some() {
            let text =
                "stage.diagonal moves x, y and z together, but the machine has [tilt], whose axes turn with x and y";
            faults.push(fault("machine-diagonal", "stage.diagonal", text, "leave out stage.diagonal"));
        }
        faults
    }
}

/// A fault of the value of a key.
fn fault(code: &'static str, key: &str, text: impl Into<String>, hint: &str) -> Fault {
    (key.to_owned(), Diag::input(code, text).hint(hint))
}

/// The JSON schema of a machine file.
pub fn json_schema() -> String {
    let schema = schemars::schema_for!(Machine);
    serde_json::to_string_pretty(&schema).expect("a schema is plain JSON")
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn every_table_of_the_schema_is_listed_as_what_it_is() {
        diag::lists_all_of(&json_schema(), &TABLES, &["servo", "move", "settle"]);
    }
}
