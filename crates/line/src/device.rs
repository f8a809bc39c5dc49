//! Who made a unit and what it is, by its own words: what to ask for all of it, and what came.
//!
//! Nothing is asked here: whoever has the line does that, in whatever way.

use std::collections::BTreeMap;

use drivebus_rtu::{Answer, ExceptionCode, IdentificationLevel, Request};

/// Most requests for one identification: some 7 000 bytes of it.
const MOST: u32 = 32;

/// Who made a unit and what it is, as it says itself (2BH/0EH). No unit has to know the function.
#[derive(Debug, Clone, PartialEq, Eq, Default)]
pub struct DeviceIdentification {
    objects: BTreeMap<u8, Vec<u8>>,
    conformity: u8,
    is_complete: bool,
}

impl DeviceIdentification {
    /// Object 00H: the maker.
    pub fn vendor(&self) -> Option<String> {
        self.text(0x00)
    }

    /// Object 01H: the maker's code for the product.
    pub fn product_code(&self) -> Option<String> {
        self.text(0x01)
    }

    /// Object 02H: major and minor revision.
    pub fn revision(&self) -> Option<String> {
        self.text(0x02)
    }

    /// Object 03H: the maker's page.
    pub fn vendor_url(&self) -> Option<String> {
        self.text(0x03)
    }

    /// Object 04H: the product.
    pub fn product_name(&self) -> Option<String> {
        self.text(0x04)
    }

    /// Object 05H: the model.
    pub fn model_name(&self) -> Option<String> {
        self.text(0x05)
    }

    /// Object 06H: the user's own name for what it does.
    pub fn application_name(&self) -> Option<String> {
        self.text(0x06)
    }

    /// All objects, by their numbers. From 80H on they are the maker's own, and need not be text.
    pub const fn objects(&self) -> &BTreeMap<u8, Vec<u8>> {
        &self.objects
    }

    /// What the unit says that it has: 01H basic, 02H regular, 03H extended; 80H more where it also gives single objects.
    pub const fn conformity(&self) -> u8 {
        self.conformity
    }

    /// Whether it is all that the unit has. It is not where the unit goes on without an end, or begins anew.
    pub const fn is_complete(&self) -> bool {
        self.is_complete
    }

    /// The object as text, without what fills it up; `None` where the unit has none.
    fn text(&self, object: u8) -> Option<String> {
        let value = String::from_utf8_lossy(self.objects.get(&object)?);
        Some(value.trim_matches(|c: char| c.is_whitespace() || c == '\0').to_owned())
    }
}

/// What to ask a unit next for its whole identification.
#[derive(Debug, Clone)]
pub struct DeviceQuestion {
    level: IdentificationLevel,
    /// The object to ask for; `None`: nothing is left to ask.
    next: Option<u8>,
    asked: u32,
    told: DeviceIdentification,
}

impl Default for DeviceQuestion {
    fn default() -> Self {
        Self::new()
    }
}

impl DeviceQuestion {
    /// Everything, from the first object on.
    pub const fn new() -> Self {
        let told = DeviceIdentification { objects: BTreeMap::new(), conformity: 0, is_complete: false };
        Self { level: IdentificationLevel::Extended, next: Some(0), asked: 0, told }
    }

    /// What to ask now; `None` once it is known.
    pub fn request(&self) -> Option<Request<'static>> {
        let object = self.next.filter(|_| self.asked < MOST)?;
        Some(Request::read_identification(self.level, object))
    }

    /// As [`answered`](Self::answered), of the PDU that the answer is.
    pub fn heard(&mut self, pdu: &[u8]) {
        match Answer::parse(pdu) {
            Ok(answer) => self.answered(&answer),
            Err(_) => self.next = None,
        }
    }

    /// The unit gave `answer`, which was judged to be one.
    pub fn answered(&mut self, answer: &Answer<'_>) {
        let Some(object) = self.next.take() else { return };
        self.asked += 1;
        let Answer::Identification { page, .. } = *answer else { return };
        // One that begins anew would do so for ever.
        if page.check(self.level, object, false).is_err() {
            return;
        }
        self.told.conformity = page.conformity();
        self.told.objects.extend(page.objects().map(|(object, value)| (object, value.to_vec())));
        self.next = page.next();
        self.told.is_complete = self.next.is_none();
    }

    /// The unit refused; whether there is something less to ask for. By the specification it answers with what it has.
    pub fn refused(&mut self, code: ExceptionCode) -> bool {
        let asks_less = self.asked == 0
            && self.level == IdentificationLevel::Extended
            && matches!(code, ExceptionCode::ILLEGAL_ADDRESS | ExceptionCode::ILLEGAL_VALUE);
        if asks_less {
            self.level = IdentificationLevel::Basic;
        }
        asks_less
    }

    /// What came.
    pub fn told(self) -> DeviceIdentification {
        self.told
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    /// Asks a unit with `objects`, and tells how often.
    fn ask(objects: &[(u8, &[u8])]) -> (DeviceIdentification, u32) {
        let (mut question, mut buffer) = (DeviceQuestion::new(), [0; drivebus_rtu::MAX_PDU]);
        while let Some(Request::ReadIdentification { level, object, .. }) = question.request() {
            question.answered(&drivebus_rtu::IdentificationPage::answer(objects, (level, object), &mut buffer));
        }
        (question.told.clone(), question.asked)
    }

    #[test]
    fn all_that_follows_is_asked_for() {
        let long = [b'x'; 200];
        let objects: &[(u8, &[u8])] =
            &[(0, b"Example "), (1, b"EX-1\0"), (2, b"V2.11"), (5, &long), (0x80, &long), (0xFF, &[0, 0xFE])];
        let (told, asked) = ask(objects);
        assert_eq!((told.is_complete(), asked), (true, 2));
        assert_eq!(told.conformity(), 0x83);
        assert_eq!((told.vendor().as_deref(), told.product_code().as_deref()), (Some("Example"), Some("EX-1")));
        assert_eq!((told.revision().as_deref(), told.vendor_url()), (Some("V2.11"), None));
        let own: Vec<_> = told.objects().iter().map(|(object, value)| (*object, value.as_slice())).collect();
        assert_eq!(own, objects);
    }

    #[test]
    fn a_unit_without_an_end_is_left_after_so_many_requests() {
        let largest = [0; 244];
        let objects: Vec<(u8, &[u8])> = (0..=255).map(|object| (object, &largest[..])).collect();
        let (told, asked) = ask(&objects);
        assert_eq!((told.is_complete(), asked, told.objects().len()), (false, MOST, 32));
    }

    #[test]
    fn a_unit_that_begins_anew_is_not_asked_for_ever() {
        let mut question = DeviceQuestion::new();
        let first = [0x2B, 0x0E, 3, 0x83, 0xFF, 9, 1, 0, 1, b'A'];
        question.answered(&Answer::parse(&first).unwrap());
        assert_eq!(question.request(), Some(Request::read_identification(IdentificationLevel::Extended, 9)));
        question.answered(&Answer::parse(&first).unwrap());
        assert_eq!(question.request(), None);
        let told = question.told();
        assert_eq!((told.is_complete(), told.vendor().as_deref()), (false, Some("A")));
    }

    #[test]
    fn who_refuses_all_is_asked_for_the_least_once() {
        let mut question = DeviceQuestion::new();
        assert!(!question.clone().refused(ExceptionCode::ILLEGAL_FUNCTION));
        assert!(question.refused(ExceptionCode::ILLEGAL_VALUE));
        assert_eq!(question.request(), Some(Request::read_identification(IdentificationLevel::Basic, 0)));
        assert!(!question.refused(ExceptionCode::ILLEGAL_VALUE));
    }
}
