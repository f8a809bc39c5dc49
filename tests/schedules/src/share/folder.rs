// There is one user.

pub(crate) fn user_named(user: u32) -> String {
    user.to_string()
}
