//! The card's two bulk pipes over USB.

use std::io;
use std::path::Path;
use std::time::Duration;

use nusb::transfer::{Buffer, Bulk, In, Out};
use nusb::{Endpoint, MaybeFuture};

use super::Transport;
use terrace_core::diag::Diag;

const VENDOR: u16 = 0x9588;
const PRODUCT: u16 = 0x9899;
const INTERFACE: u8 = 0;
const WRITE: u8 = 0x02;
const READ: u8 = 0x88;

/// The longest that one transfer may take.
const TIMEOUT: Duration = Duration::from_secs(1);

/// The cards that are connected, by their serial numbers.
///
/// # Errors
/// Why the system does not say.
pub(super) fn cards() -> Result<Vec<String>, String> {
    // Of Linux without USB, as in a container, nusb says that it failed.
    if cfg!(target_os = "linux") && !Path::new("/sys/bus/usb/devices").exists() {
        return Ok(Vec::new());
    }
    let devices = nusb::list_devices().wait().map_err(|e| e.to_string())?;
    let cards = devices.filter(|d| (d.vendor_id(), d.product_id()) == (VENDOR, PRODUCT));
    Ok(cards.map(|card| format!("serial number {}", card.serial_number().unwrap_or("none"))).collect())
}

pub(super) struct Usb {
    write: Endpoint<Bulk, Out>,
    read: Endpoint<Bulk, In>,
}

impl Usb {
    /// Opens the card with a serial number, or the only one.
    pub(super) fn open(serial: Option<&str>) -> Result<Self, Diag> {
        let devices = nusb::list_devices().wait().map_err(|e| fault(&e.to_string()))?;
        let cards: Vec<_> = devices.filter(|d| (d.vendor_id(), d.product_id()) == (VENDOR, PRODUCT)).collect();
        let found: Vec<_> = cards.iter().filter(|d| serial.is_none() || d.serial_number() == serial).collect();
        let [card] = found[..] else {
            let numbers: Vec<_> = cards.iter().map(|d| d.serial_number().unwrap_or("none")).collect();
            let text = format!("{} of {} BJJCZ cards fit; their serial numbers: {numbers:?}", found.len(), cards.len());
            return Err(fault(&text));
        };
        let opened = card.open().wait().and_then(|device| {
            let interface = device.detach_and_claim_interface(INTERFACE).wait()?;
            Ok(Self { write: interface.endpoint(WRITE)?, read: interface.endpoint(READ)? })
        });
        opened.map_err(|e| fault(&e.to_string()))
    }
}

impl Transport for Usb {
    fn write(&mut self, packet: &[u8]) -> io::Result<()> {
        let done = self.write.transfer_blocking(packet.to_vec().into(), TIMEOUT);
        done.status.map_err(io::Error::other)?;
        if done.actual_len == packet.len() { Ok(()) } else { Err(io::Error::other("the card took a part of a packet")) }
    }

    fn read(&mut self) -> io::Result<[u8; 8]> {
        let buffer = Buffer::new(self.read.max_packet_size());
        let done = self.read.transfer_blocking(buffer, TIMEOUT);
        done.status.map_err(io::Error::other)?;
        let answer = done.buffer.first_chunk().copied().filter(|_| done.actual_len >= 8);
        answer.ok_or_else(|| io::Error::other("the card gave a short answer"))
    }
}

fn fault(why: &str) -> Diag {
    Diag::input("lmc-usb", format!("the card cannot be opened over USB: {why}")).hint(
        "is it connected and switched on? On Linux its device (9588:9899) must be writable, by a udev rule; on Windows \
         it needs the WinUSB driver; laser.serial chooses among several",
    )
}
