"""What people read: tables of text, pictures, and a report that is one HTML file."""
