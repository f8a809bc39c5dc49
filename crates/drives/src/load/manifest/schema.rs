//! The JSON schema of `profile.toml`, for editors: made of the types that read the file, so that both say the same. It says
//! which keys there are and of which type; what their values must be to make sense, `drivebus profiles check` says.

use std::collections::BTreeMap;
use std::path::Path;

use schemars::generate::SchemaSettings;
use schemars::transform::{RestrictFormats, Transform, transform_subschemas};
use schemars::{JsonSchema, Schema, SchemaGenerator, json_schema};
use serde_json::{Map, Value};

use super::Manifest;
use crate::profile::Profile;

/// A table whose keys are all known by name.
pub(super) fn table<K: JsonSchema, V: JsonSchema>(generator: &mut SchemaGenerator) -> Schema {
    let names = K::json_schema(generator);
    let value = generator.subschema_for::<V>();
    let key = |name: &Value| {
        let mut value = value.clone();
        let description = name["description"].clone();
        value.insert("description".to_owned(), description);
        (name["const"].as_str().unwrap().to_owned(), value.into())
    };
    let keys: Map<String, Value> = names.get("oneOf").and_then(Value::as_array).unwrap().iter().map(key).collect();
    json_schema!({ "type": "object", "properties": keys, "additionalProperties": false })
}

/// TOML has no null: what may be missing is left out.
#[derive(Clone)]
struct WithoutNull;

impl Transform for WithoutNull {
    fn transform(&mut self, schema: &mut Schema) {
        transform_subschemas(self, schema);
        let Some(object) = schema.as_object_mut() else { return };
        if let Some(Value::Array(types)) = object.get_mut("type") {
            types.retain(|kind| kind != "null");
            if let [only] = types.as_slice() {
                let only = only.clone();
                object.insert("type".to_owned(), only);
            }
        }
        if let Some(Value::Array(options)) = object.get_mut("anyOf") {
            options.retain(|option| option["type"] != "null");
            if let [only] = options.as_mut_slice() {
                let only = only.take();
                object.remove("anyOf");
                object.extend(only.as_object().cloned().unwrap_or_default());
            }
        }
        if object.get("default").is_some_and(Value::is_null) {
            object.remove("default");
        }
    }
}

/// The schema of what a profile can be: what may be missing over another one is needed where there is none.
fn schema() -> Value {
    let settings = SchemaSettings::draft07().with_transform(WithoutNull).with_transform(RestrictFormats::default());
    let mut schema = settings.into_generator().into_root_schema_for::<Manifest>();
    schema.insert("title".to_owned(), "profile.toml of drivebus".into());
    let over = ["extends", "overlay"].map(|table| json_schema!({ "required": [table] }));
    schema.insert("if".to_owned(), json_schema!({ "not": { "anyOf": over } }).into());
    let alone = ["title", "kind", "version", "requests", "parameters"];
    schema.insert("then".to_owned(), json_schema!({ "required": alone }).into());
    schema.into()
}

#[test]
fn the_shipped_schema_is_that_of_the_types() {
    if std::env::var_os("DRIVEBUS_WRITE_SCHEMA").is_some() {
        let file = Path::new(env!("CARGO_MANIFEST_DIR")).join("profiles/profile.schema.json");
        std::fs::write(file, format!("{:#}\n", schema())).unwrap();
        return;
    }
    let shipped: Value = serde_json::from_str(Profile::schema()).unwrap();
    assert!(shipped == schema(), "the format has changed: `make schema` writes its schema anew");
}

#[test]
fn a_table_of_names_has_each_of_them() {
    #[derive(JsonSchema)]
    #[allow(dead_code, reason = "only its schema is looked at")]
    #[schemars(rename_all = "snake_case")]
    enum Name {
        /// One thing.
        OneThing,
        /// Another.
        Other,
    }
    let table = table::<Name, BTreeMap<String, bool>>(&mut SchemaGenerator::default());
    let value = |description| json_schema!({ "type": "object", "additionalProperties": { "type": "boolean" }, "description": description });
    let keys = json_schema!({ "one_thing": value("One thing."), "other": value("Another.") });
    assert_eq!(table, json_schema!({ "type": "object", "properties": keys, "additionalProperties": false }));
}
