/* Included before the C of every module that mypyc has written: see `quicken` in deploy/compile.py.

mypyc leaves NamedTuples and the names of a module to the interpreter's runtime. A step of the
vehicle makes some forty NamedTuples, each by a Python function, `lambda cls, a, b:
tuple.__new__(cls, (a, b))`, and looks up several hundred fields and names. Here each has a path
that gives the same object with fewer instructions; whatever is not plainly such a case takes the
usual path. */

#include <Python.h>

PyObject *CPyDict_GetItem(PyObject *dict, PyObject *key);

/* Where an error passes: GCC places what only leads there away from what every step runs. */
__attribute__((cold)) void CPy_AddTraceback(
    const char *filename, const char *funcname, int line, PyObject *globals);
__attribute__((cold)) void CPy_TypeErrorTraceback(
    const char *filename, const char *funcname, int line, PyObject *globals,
    const char *expected, PyObject *value);

/* Functions of the module math that mypyc leaves to the interpreter: see `shorten_math`. Each
gives what Modules/mathmodule.c of CPython gives for floats. */
static inline char flight_stack_isfinite(double x) { return isfinite(x) != 0; }
static inline double flight_stack_radians(double x) { return x * (Py_MATH_PI / 180.0); }
static inline double flight_stack_degrees(double x) { return x * (180.0 / Py_MATH_PI); }
static inline double flight_stack_atan2(double y, double x) { return atan2(y, x); }

/* Entry of the dictionary of a class whose base is tuple, borrowed; NULL for anything else. */
static PyObject *flight_stack_entry(PyTypeObject *type, PyObject **key, const char *name)
{
    if (type->tp_base != &PyTuple_Type || type->tp_dict == NULL) {
        return NULL;
    }
    if (*key == NULL && (*key = PyUnicode_InternFromString(name)) == NULL) {
        PyErr_Clear();
        return NULL;
    }
    return PyDict_GetItemWithError(type->tp_dict, *key);
}

/* Names of the fields of a NamedTuple class, borrowed; NULL for anything else. */
static PyObject *flight_stack_fields(PyTypeObject *type)
{
    static PyObject *key = NULL;
    PyObject *fields = flight_stack_entry(type, &key, "_fields");
    return fields != NULL && PyTuple_CheckExact(fields) ? fields : NULL;
}

/* Default of a field of a NamedTuple class, borrowed; NULL if it has none. */
static PyObject *flight_stack_default(PyTypeObject *type, PyObject *field)
{
    static PyObject *key = NULL;
    PyObject *defaults = flight_stack_entry(type, &key, "_field_defaults");
    return defaults == NULL ? NULL : PyDict_GetItemWithError(defaults, field);
}

/* Makes a NamedTuple of all its fields in their order. */
static inline PyObject *flight_stack_make(
    PyTypeObject *type, PyObject *const *values, Py_ssize_t number)
{
    PyObject *made = type->tp_alloc(type, number);
    for (Py_ssize_t i = 0; made != NULL && i < number; i++) {
        PyTuple_SET_ITEM(made, i, Py_NewRef(values[i]));
    }
    return made;
}

/* A call; if it is of a NamedTuple class with its fields in their order, the last ones perhaps by
default, the tuple is made here. A place in the code remembers the class to which it has given all
fields; it does so in the same way the next time. */
typedef struct {
    PyObject *callable, *names;
    Py_ssize_t given;
} flight_stack_whole;

static PyObject *flight_stack_call(
    flight_stack_whole *whole, PyObject *callable, PyObject *const *arguments, size_t flags,
    PyObject *names)
{
    Py_ssize_t placed = PyVectorcall_NARGS(flags);
    Py_ssize_t named = names == NULL ? 0 : PyTuple_GET_SIZE(names), given = placed + named;
    PyTypeObject *type = (PyTypeObject *)callable;
    if (callable == whole->callable && names == whole->names && given == whole->given) {
        return flight_stack_make(type, arguments, given);
    }
    PyObject *fields = PyType_Check(callable) ? flight_stack_fields(type) : NULL;
    Py_ssize_t all = fields == NULL ? -1 : PyTuple_GET_SIZE(fields);
    int is_whole = given <= all;
    for (Py_ssize_t i = 0; is_whole && i < named; i++) { /* Both are interned */
        is_whole = PyTuple_GET_ITEM(names, i) == PyTuple_GET_ITEM(fields, placed + i);
    }
    for (Py_ssize_t i = given; is_whole && i < all; i++) {
        is_whole = flight_stack_default(type, PyTuple_GET_ITEM(fields, i)) != NULL;
    }
    if (!is_whole) {
        return PyObject_Vectorcall(callable, arguments, flags, names);
    }
    if (given == all && whole->callable == NULL) {
        whole->callable = Py_NewRef(callable);
        whole->names = Py_XNewRef(names);
        whole->given = given;
        return flight_stack_make(type, arguments, given);
    }
    PyObject *made = type->tp_alloc(type, all);
    for (Py_ssize_t i = 0; made != NULL && i < all; i++) {
        PyObject *value = i < given
            ? arguments[i] : flight_stack_default(type, PyTuple_GET_ITEM(fields, i));
        PyTuple_SET_ITEM(made, i, Py_NewRef(value));
    }
    return made;
}

/* Place of a field in a NamedTuple class; -1 if the name is not one of its fields as such. */
static Py_ssize_t flight_stack_place(PyTypeObject *type, PyObject *name)
{
    PyObject *fields = flight_stack_fields(type);
    PyObject *getter = fields == NULL ? NULL : PyDict_GetItemWithError(type->tp_dict, name);
    if (getter == NULL || strcmp(Py_TYPE(getter)->tp_name, "collections._tuplegetter") != 0) {
        return -1;
    }
    for (Py_ssize_t i = 0; i < PyTuple_GET_SIZE(fields); i++) {
        if (PyTuple_GET_ITEM(fields, i) == name) {
            return i;
        }
    }
    return -1;
}

/* What a place in the code has seen of an attribute: of a NamedTuple or of a module. */
typedef struct {
    PyTypeObject *type; /* Of the last object, if a NamedTuple */
    Py_ssize_t place; /* Of the field */
    uint64_t version; /* Of the module's dictionary: another tag after every change (PEP 509) */
    PyObject *value; /* Borrowed: the dictionary holds it as long as the tag is the same */
} flight_stack_site;

/* An attribute of a module, or NULL; of a NamedTuple it notes the place for the next time. */
static __attribute__((noinline)) PyObject *flight_stack_attribute(
    flight_stack_site *site, PyObject *whole, PyObject *name)
{
#if PY_VERSION_HEX < 0x030C0000
    if (PyModule_CheckExact(whole)) {
        PyDictObject *globals = (PyDictObject *)PyModule_GetDict(whole);
        if (site->value == NULL || site->version != globals->ma_version_tag) {
            site->value = PyDict_GetItemWithError((PyObject *)globals, name);
            site->version = globals->ma_version_tag;
        }
        return Py_XNewRef(site->value);
    }
#endif
    Py_ssize_t found = flight_stack_place(Py_TYPE(whole), name);
    if (found >= 0) {
        site->place = found;
        site->type = (PyTypeObject *)Py_NewRef((PyObject *)Py_TYPE(whole));
    }
    return NULL;
}

#define FLIGHT_STACK_GETATTR(object, name) \
    ({ \
        static flight_stack_site site; \
        PyObject *whole = (object), *got; \
        if (Py_TYPE(whole) == site.type) { \
            got = Py_NewRef(PyTuple_GET_ITEM(whole, site.place)); \
        } else if ((got = flight_stack_attribute(&site, whole, (name))) == NULL) { \
            got = CPyObject_GetAttr(whole, (name)); \
        } \
        got; \
    })

/* A name of a module. A dictionary has another version tag after every change (PEP 509). */
#if PY_VERSION_HEX < 0x030C0000
#define FLIGHT_STACK_GLOBAL(dict, name) \
    ({ \
        static uint64_t version = 0; \
        static PyObject *value = NULL; \
        PyObject *globals = (dict); \
        if (version == ((PyDictObject *)globals)->ma_version_tag && value != NULL) { \
            Py_INCREF(value); \
        } else { \
            value = CPyDict_GetItem(globals, (name)); \
            version = ((PyDictObject *)globals)->ma_version_tag; \
        } \
        value; \
    })
#else
#define FLIGHT_STACK_GLOBAL(dict, name) CPyDict_GetItem((dict), (name))
#endif

#define PyObject_Vectorcall(callable, arguments, flags, names) \
    ({ \
        static flight_stack_whole whole; \
        flight_stack_call(&whole, (callable), (arguments), (flags), (names)); \
    })

/* A float is read in place. */
static inline double flight_stack_float(PyObject *number)
{
    return PyFloat_CheckExact(number) ? PyFloat_AS_DOUBLE(number) : PyFloat_AsDouble(number);
}
#define PyFloat_AsDouble flight_stack_float
