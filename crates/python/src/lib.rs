//! The extension module `drivebus._native`: converts between Python and the core, and decides nothing.
//!
//! A rule about Modbus or about drives that stood here would exist for Python only. What this module offers is written
//! down, with units, ranges and errors, in `python/drivebus/_native.pyi`.

use pyo3::prelude::*;

mod aim;
mod arguments;
mod attendant;
mod bus;
mod bus_timeout;
mod clock;
mod convert;
mod device;
mod ending;
mod errors;
mod family;
mod format;
mod frames;
mod gateway;
mod given;
mod guard;
mod halt;
mod halter;
mod identify;
mod look;
mod mailbox;
mod not_done;
mod not_kept;
mod open;
mod overhear;
mod plan;
mod poll;
mod profile;
mod pyserial;
mod record;
mod requests;
mod rule;
mod same_unit;
mod set_otherwise;
mod sheet;
mod shown_look;
mod signals;
mod sim;
mod sim_line;
mod sniffer;
mod tables;
mod task;
mod trace;
mod unit;
mod values;
mod waits;

/// But for `ending`, nothing here keeps state outside its objects, and each of those locks for itself: safe without the GIL.
#[pymodule(gil_used = false)]
mod _native {
    use pyo3::prelude::*;

    #[pymodule_export]
    use crate::bus::Bus;
    #[pymodule_export]
    use crate::bus_timeout::BusTimeout;
    #[pymodule_export]
    use crate::device::{DeviceQuestion, device_objects};
    #[pymodule_export]
    use crate::ending::{begin_of_child, end_of_program};
    #[pymodule_export]
    use crate::family::{Family, begin_families, code_places, code_rows, listed_codes};
    #[pymodule_export]
    use crate::format::SerialFormat;
    #[pymodule_export]
    use crate::frames::{
        all_frames_in, crc16, decode, decode_answer, encode_echo, encode_read, encode_write, frame_len, frames_in,
        huanyang_form, is_write, judge, may_be_of, misses, only_reads, touched,
    };
    #[pymodule_export]
    use crate::gateway::Gateway;
    #[pymodule_export]
    use crate::guard::{commanded_at, forbidden};
    #[pymodule_export]
    use crate::halt::{Halt, halt_all};
    #[pymodule_export]
    use crate::identify::{identify, usable};
    #[pymodule_export]
    use crate::look::Looks;
    #[pymodule_export]
    use crate::mailbox::Mailbox;
    #[pymodule_export]
    use crate::open::{check_port_options, port_facts, port_url, run_time_folder};
    #[pymodule_export]
    use crate::plan::Plan;
    #[pymodule_export]
    use crate::poll::{Batch, Poller};
    #[pymodule_export]
    use crate::profile::{Profile, exception_means};
    #[pymodule_export]
    use crate::record::Record;
    #[pymodule_export]
    use crate::requests::{Asked, Requests, open_bus};
    #[pymodule_export]
    use crate::rule::Rule;
    #[pymodule_export]
    use crate::same_unit::{Identity, SameUnit};
    #[pymodule_export]
    use crate::sheet::read_sheet;
    #[pymodule_export]
    use crate::sim::{SimulatedDrive, Simulator};
    #[pymodule_export]
    use crate::sim_line::{SimulatedLine, fault_kinds};
    #[pymodule_export]
    use crate::sniffer::Sniffer;
    #[pymodule_export]
    use crate::task::Task;
    #[pymodule_export]
    use crate::unit::Unit;
    #[pymodule_export]
    use crate::values::Values;

    #[pymodule_init]
    fn init(module: &Bound<'_, PyModule>) -> PyResult<()> {
        module.add("STORES_BEFORE_NOTICE", drivebus_drive::Record::STORES_BEFORE_NOTICE)?;
        module.add("HALT_WITHIN", drivebus_drive::Order::WITHIN.as_secs_f64())?;
        module.add("STANDSTILL", drivebus_drive::STANDSTILL)?;
        module.add("__version__", env!("CARGO_PKG_VERSION"))
    }
}
